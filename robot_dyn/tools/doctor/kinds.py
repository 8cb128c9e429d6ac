"""Kinds of findings. The page of findings lists them from these docstrings."""

from __future__ import annotations

from enum import StrEnum
from typing import final


@final
class FindingKind(StrEnum):
    """Kinds of findings of `check_urdf`. A docstring is the criterion, then what a repair changes."""

    REFUSED = "refused"
    """`load` refuses the file. The line of the element is given if it is known."""
    FORMAT = "format"
    """The file departs from the format, see the table above. Repaired: the XML declaration."""
    UNKNOWN_ELEMENT = "unknown_element"
    """An element of a link or joint has a name that URDF does not have. A misspelt name is an error if M depends on
    it, otherwise a warning. Repaired: the name."""
    UNKNOWN_ATTRIBUTE = "unknown_attribute"
    """An attribute of a link or joint has a name that URDF does not have. Same severity as `unknown_element`.
    Repaired: the name."""
    DECIMAL_COMMA = "decimal_comma"
    """A number has a decimal comma, such as 0,5. Repaired: yes."""
    LINE_BREAK = "line_break"
    """A line end or tab separates numbers: urdfdom then drops the whole `<inertial>`. Repaired: yes."""
    DEGREES = "degrees"
    """An angle exceeds a turn; a limit in whole degrees exceeds 20, or any limit four turns. Repaired: rpy, if all
    angles are multiples of 15°; both limits, if both are whole degrees (crossed limits are then exchanged)."""
    ORIGIN_FAR = "origin_far"
    """The origin of a joint, or a centre of mass, is farther than 100 times the median joint distance. With three
    or more such joints, also a centre of mass beyond twice the longest distance and 0.3 m; an error for moving
    links. With one or two, an origin beyond 10 m."""
    AXIS_MISSING = "axis_missing"
    """A moving joint has no `<axis>`, which means x."""
    EFFORT_GRAVITY = "effort_gravity"
    """The effort limit is below the torque of gravity at q = 0, or as near to it as the limits allow. An error, or
    a note if masses or lengths are doubtful as well."""
    NEAR_RIGHT_ANGLE = "near_right_angle"
    """An angle is a multiple of π/2, rounded to the written digits. Repaired: yes."""
    LIMIT_MISSING = "limit_missing"
    """A moving joint has no limit. A note if only the velocity limit is missing, otherwise a warning."""
    LIMIT_ZERO = "limit_zero"
    """An effort or velocity limit of a moving joint is 0."""
    LIMIT_NEGATIVE = "limit_negative"
    """An effort or velocity limit of a moving joint is negative. Repaired: the sign."""
    LIMITS_CROSSED = "limits_crossed"
    """The lower limit exceeds the upper one. Repaired: the order."""
    LIMITS_EQUAL = "limits_equal"
    """The lower limit equals the upper one: the joint cannot move."""
    SOFT_LIMITS = "soft_limits"
    """The soft limits of `<safety_controller>` are crossed or equal, or lie outside the limits of the joint."""
    NAME_TWICE = "name_twice"
    """Two links, or two joints, have one name."""
    NAME_BLANKS = "name_blanks"
    """A name has blanks at its ends. Repaired: yes."""
    NAME_LETTERS = "name_letters"
    """A name has blanks, slashes or letters beyond ASCII, which other programs refuse."""
    NAME_SHARED = "name_shared"
    """A link and a joint have the same name, which some programs refuse."""
    XACRO = "xacro"
    """The file contains an unexpanded expression of xacro."""
    MASS_MISSING = "mass_missing"
    """A body has no mass. An error if the link is drawn or M is singular, and a warning between the axes of a wrist
    or hip."""
    MASS_TINY = "mass_tiny"
    """A mass is below 1e-12 kg."""
    INERTIA_MISSING = "inertia_missing"
    """The body of a joint has mass but no inertia about the axis, so that M is singular."""
    INERTIA_IMPOSSIBLE = "inertia_impossible"
    """Moments are negative or violate the triangle inequality, see above; merged links are checked, too."""
    INERTIA_WITHOUT_MASS = "inertia_without_mass"
    """A moving link has moments but no mass."""
    LENGTH_LONG = "length_long"
    """A distance exceeds 1e4 m."""
    MIMIC_RATIO = "mimic_ratio"
    """A chain of mimic joints multiplies by more than 1e4."""
    MIMIC_LIMITS = "mimic_limits"
    """A follower exceeds its limits, see above."""
    OTHER_PROGRAMS = "other_programs"
    """The file states a rotor inertia or a spring for other programs, see above."""
    BASE_MOBILE = "base_mobile"
    """Names suggest a mobile base, see below."""
    INERTIA_ZERO = "inertia_zero"
    """A link with mass has a principal moment of 0: a rod or a point, which other programs refuse. A warning if at
    least two links, and at least half of the moving ones, have a shape but all moments 0."""
    MASS_RATIO = "mass_ratio"
    """Moving bodies differ by more than 1e4 in mass."""
    MASS_NEIGHBOURS = "mass_neighbours"
    """A moving body is 30 times lighter than each of its neighbours, and, at the end of an arm, 10 times lighter
    than all other bodies. Or it is 4 times heavier than its neighbours and has 8000 to 12000 kg/m³, steel to lead,
    in its shape."""
    MASS_SHEET = "mass_sheet"
    """A mass given with `--mass` or `--total-mass` differs from the one in the file by more than 5 %."""
    INERTIA_WIDE = "inertia_wide"
    """For links without a shape: k = √(½ tr I / m) exceeds the distance to the next joint, the distance of the
    centre of mass, and half the longest distance between joints. In arms of one or two moving joints: k > 3 m."""
    INERTIA_UNIT = "inertia_unit"
    """The median of k, relative to these distances, is above 8, and 90 % of the links exceed 1: a common unit such
    as kg mm². Repaired: with `--inertia-unit`."""
    INERTIA_SHAPE = "inertia_shape"
    """½ tr I > 1.1 m d², d the farthest point of the shape from the centre of mass: impossible for any density. An
    error above 3 m d², otherwise a warning. Repaired: a single suspected mistake, with `--units`."""
    INERTIA_DIRECTION = "inertia_direction"
    """nᵀΣn > 1.21 m max ((x − c)·n)² along an axis or an eigenvector n of Σ = ½ tr I · 1 − I, x the points of
    visual and collision: moments exchanged between axes, or a wrong sign of a product. A warning above 3, otherwise
    a note. Repaired: a single suspected mistake, with `--units`."""
    MASS_DENSITY = "mass_density"
    """The density is below 2 or above 1.2e4 kg/m³ in the hull of the shape; grams are suspected if they explain it.
    Repaired: with `--units`."""
    DENSITY_UNIFORM = "density_uniform"
    """At least four masses, and 60 % of all, are within 1 % of one density times the volume of the shapes: CAD
    computed them from one material. Compare the total with the data sheet."""
    INERTIA_SMALL = "inertia_small"
    """tr I < 0.15 of a uniform body with mass and shape of the link: for example a mass that is 10 times too
    large."""
    INERTIA_FAR = "inertia_far"
    """½ tr I > m (10 L)², as above, and no shape shows it already."""
    COM_OUTSIDE = "com_outside"
    """The centre of mass lies outside the box of the shape, by more than a tenth of its longest edge and 1 cm."""
    SHAPE_IN_MM = "shape_in_mm"
    """A shape is 10 times as long as the robot, and longer than 10 m. Repaired: with `--units`, the scale of
    meshes."""
    SHAPE_MISSING = "shape_missing"
    """A mesh is not found or not readable."""
    SHAPE_ELSEWHERE = "shape_elsewhere"
    """Meshes are not at their paths, for example those of another computer; they were found by the end of their
    path in folders near the URDF."""
    INERTIAL_MISSING = "inertial_missing"
    """A link has a shape of some volume and no `<inertial>`, or a mass and no moments. Repaired: with `--mass`,
    `--total-mass` or `--density`."""
    INERTIAL_ESTIMATED = "inertial_estimated"
    """`<inertial estimated="…">`: estimated from shapes, not measured."""
