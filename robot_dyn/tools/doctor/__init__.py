"""The doctor of robot files: faults, doubtful values and repairs of one; differences of two.

    check_urdf     the findings of a file, and its repairs (Checkup)
    diff_robots    the difference of two descriptions of one robot, in N m too (RobotDifference)

checkup, report                   the whole check; findings as text
document, finding, kinds          the file; findings, their kinds, and changes
spelling, literals, names         findings in the text
limits, axes, proportions         findings in joints and lengths
masses, gravity_load              findings in the numbers of the robot
neighbours                        masses and moments against joint distances, other links and a data sheet
shapes, estimate                  comparison with the shapes of links; missing inertials
robot_difference                  two descriptions of one robot, compared
coordinate_map, largest_difference   the map of their coordinates; the search for the largest differences of N and M
command                           the commands `check-urdf` and `diff-robots`
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
