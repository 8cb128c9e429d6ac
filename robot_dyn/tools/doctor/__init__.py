"""The doctor of URDF files: faults, doubtful values, and repairs.

    check_urdf    the findings of a file, and its repairs (Checkup)

checkup, report                   the whole check; findings as text
document, finding, kinds          the file; findings, their kinds, and changes
spelling, literals, names         findings in the text
limits, axes, proportions         findings in joints and lengths
masses, gravity_load              findings in the numbers of the robot
neighbours                        masses and moments against joint distances, other links and a data sheet
shapes, estimate                  comparison with the shapes of links; missing inertials
command                           the command `check-urdf`
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
