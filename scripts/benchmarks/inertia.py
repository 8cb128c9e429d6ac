"""Inertias estimated from shapes, against those that makers state: what inertia="from_shapes" of `load` may be off by.

Inertials are removed and estimated again: with the true mass of each link, with the total mass, with a density. Makers
in alphabetical order belong to two halves in turn: from one the rules and the density were chosen, the other one judges
them. Errors are, for each link that moves, of

    mass      |m − m*| / m*
    centre    |c − c*| / the median distance between neighbouring joints of the arm
    moments   ‖I − I*‖ / ‖I*‖, each about its own centre, Frobenius norms

and for each arm, over 20 configurations within its limits,

    gravity   largest |N − N*| of all joints / largest |N*|
    M         ‖D (M − M*) D‖ / ‖D M* D‖ with D = diag(M*)^(−1/2)
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np

import robot_dyn as rd
from benchmarks.measure import command_line, row, table
from robot_dyn.description.description import Description, check
from robot_dyn.description.edits import Edits
from robot_dyn.description.inertia import MassProperties
from robot_dyn.description.structure import structure_of
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.spatial import rotation_rpy
from robot_dyn.shapes.estimate import estimates, marked, shapes_of_incomplete_links
from robot_dyn.shapes.masses import Masses

DENSITY = 1160.0  # [kg/m³], the median of the links of the half from which the rules were chosen
STATES = 20
ERRORS = ("mass", "centre", "moments", "gravity", "M")
INSTALLED = {  # names of the catalog by maker
    "Franka": ("panda",), "Kinova": ("kinova",), "PAL": ("talos_left_arm", "tiago_no_hand"), "UFACTORY": ("xarm7",),
    "Unitree": ("z1",), "UR": ("ur3", "ur5", "ur10"),
}  # fmt: skip
FETCHED: dict[str, dict[str, tuple[Any, ...]]] = {  # repository and files by maker; with values for xacro
    "Aubo": {"AuboRobot/aubo_robot": ("aubo_i3.urdf", "aubo_i5.urdf", "aubo_i10.urdf")},
    "Dobot": {"Dobot-Arm/DOBOT_6Axis_ROS2_V4": ("cr5_robot.urdf", "cr10_robot.urdf", "nova2_robot.urdf")},
    "Doosan": {"doosan-robotics/doosan-robot2": ("m1013.white.urdf",)},
    "Fanuc": {"FANUC-CORPORATION/fanuc_description": ("crx10ia.urdf.xacro",)},
    "Franka": {"frankaemika/franka_description": ("fr3.urdf.xacro", "fer.urdf.xacro")},
    "Hans": {"hans-robot/elfin_robot": ("elfin5.urdf.xacro", "elfin10.urdf.xacro")},
    "JAKA": {"JakaCobot/jaka_robot": ("jaka_zu12.urdf", "jaka_minicobo.urdf")},
    "Kinova": {
        "Kinovarobotics/ros_kortex": (
            "GEN3-7DOF-NOVISION_FOR_URDF_ARM_V12.urdf",
            "GEN3-6DOF_NO-VISION_URDF_ARM_V01.urdf",
        )
    },
    "KUKA": {
        "lbr-stack/lbr_fri_ros2_stack": ("iiwa7.xacro", "iiwa14.xacro", "med7.xacro"),
        "kroshu/kuka_robot_descriptions": ("lbr_iisy11_r1300.urdf.xacro", "kr6_r900_2.urdf.xacro"),
    },
    "Niryo": {"NiryoRobotics/ned_ros": ("niryo_ned2.urdf.xacro",)},
    "Rethink": {"RethinkRobotics/sawyer_robot": ("sawyer_base.urdf.xacro",)},
    "Robot Studio": {"TheRobotStudio/SO-ARM100": ("so100.urdf", "so101_new_calib.urdf")},
    "Robotis": {"ROBOTIS-GIT/open_manipulator": ("open_manipulator_x.urdf.xacro", "omy_3m.urdf.xacro")},
    "Techman": {"TechmanRobotInc/tmr_ros2": ("tm12.urdf.xacro",)},
    "Trossen": {"Interbotix/interbotix_ros_manipulators": ("vx300s.urdf.xacro", "wx250s.urdf.xacro")},
    "UFACTORY": {
        "xArm-Developer/xarm_ros2": (
            ("xarm_device.urdf.xacro", {"dof": "6"}),
            ("xarm_device.urdf.xacro", {"dof": "6", "robot_type": "lite"}),
        )
    },
    "UR": {
        "UniversalRobots/Universal_Robots_ROS2_Description": tuple(
            ("ur.urdf.xacro", {"name": "ur", "ur_type": kind}) for kind in ("ur3e", "ur5e", "ur10e", "ur16e", "ur20")
        )
    },
}
MAKERS = sorted({*INSTALLED, *FETCHED}, key=str.casefold)
CHOSEN = MAKERS[::2]
_KNOWN = ("of each link", "total", "density")  # the masses that are known
_LEAST = 1e-3  # of the mass of the arm: lighter links are not judged, since makers fill in any number
_INERTIAL = re.compile(rb"<inertial\b.*?</inertial\s*>", re.DOTALL)


@final
@dataclass(frozen=True)
class Judged:
    """Errors of one arm: by kind of masses and of error, a value for each link or one of the arm."""

    maker: str
    name: str
    links: int
    errors: dict[str, dict[str, list[float]]]


def main() -> None:
    parser = command_line(__doc__, "the arms of the installed package alone")
    parser.add_argument("--repositories", type=Path, metavar="FOLDER", help="owner+name/…: clones of the repositories")
    arguments = parser.parse_args()
    if arguments.repositories is None and not arguments.quick:
        parser.error("give the folder of the repositories, or --quick")
    found = list[Judged]()
    for maker, name, robot, package_dirs in _arms(None if arguments.quick else arguments.repositories):
        try:
            found.append(judged(maker, name, robot, package_dirs))
        except RobotDynError as error:
            print(f"left out: {maker} {name}: {error}")
    halves = (("the rules were chosen from", True), ("the rules are judged by", False))
    for what, chosen in halves:
        half = [each for each in found if (each.maker in CHOSEN) == chosen]
        print(f"\n{what}: {len(half)} arms, {sum(each.links for each in half)} links that move\n")
        _table(half)
        _by_arm(half)


def _table(half: list[Judged]) -> None:
    table("masses", *(f"{error}, {which}" for error in ERRORS for which in ("median", "90 %")))
    for masses in _KNOWN if half else ():
        cells = []
        for error in ERRORS:
            values = [x for each in half for x in each.errors[masses][error]]
            cells += [f"{100 * np.quantile(values, share):.0f} %" for share in (0.5, 0.9)]
        row(masses, *cells)


def _by_arm(half: list[Judged]) -> None:
    """Gravity torque and M of each arm."""
    table("arm", "links", *(f"{error}, {masses}" for error in ERRORS[3:] for masses in _KNOWN))
    for each in half:
        cells = (f"{100 * each.errors[masses][error][0]:.0f} %" for error in ERRORS[3:] for masses in _KNOWN)
        row(f"{each.maker} {each.name}", str(each.links), *cells)


def _arms(repositories: Path | None) -> Iterator[tuple[str, str, rd.Robot, tuple[Path, ...]]]:
    """Maker, name, robot and folders of packages of each arm."""
    warnings.simplefilter("ignore", rd.ModelWarning)
    for maker in MAKERS:
        for name in INSTALLED.get(maker, ()):
            yield maker, name, rd.load(name), ()
        for repository, files in FETCHED.get(maker, {}).items():
            if repositories is None:
                continue
            folder = repositories / repository.replace("/", "+")
            for file, xacro in (each if isinstance(each, tuple) else (each, {}) for each in files):
                path = next(iter(sorted(folder.rglob(file))), None)
                if path is None:
                    print(f"left out: {maker} {file} is not in {folder}")
                    continue
                name = " ".join([file.split(".")[0], *(x for key, x in xacro.items() if key != "name")])
                yield (
                    maker,
                    name,
                    rd.load(path, package_dirs=[folder], xacro=xacro if path.suffix == ".xacro" else None),
                    (folder,),
                )


def judged(maker: str, name: str, robot: rd.Robot, package_dirs: tuple[Path, ...] = ()) -> Judged:
    """The errors of the estimates of one arm, of its links that have a mass and a shape."""
    true = stated(robot.description)
    bare = check(_INERTIAL.sub(b"", robot.description.text), robot.description.source)
    shapes = {link: shape for link, shape in shapes_of_incomplete_links(bare, package_dirs)[0].items() if link in true}
    arm = rd.Robot(_kept(robot.description, shapes.keys()))
    total = sum(true[link].mass for link in shapes)
    of_each = Masses({link: true[link].mass for link in shapes})
    known = zip(_KNOWN, (of_each, Masses({}, total=total), Masses({}, density=DENSITY)), strict=True)
    base, least = structure_of(robot.description, Edits()).base, _LEAST * sum(body.mass for body in true.values())
    moving = [link for link in shapes if link not in base and true[link].mass > least]
    errors = {}
    for what, masses in known:
        found = {each.link: each for each in estimates(bare, shapes, masses, {})[0]}
        errors[what] = _of_links([(true[link], found[link].body) for link in moving], _length(robot.description))
        errors[what] |= _of_arm(arm, rd.Robot(marked(bare, found.values())))
    return Judged(maker, name, len(moving), errors)


def stated(description: Description) -> dict[str, MassProperties]:
    """Mass properties of each link with a mass and possible moments, in the frame of the link."""
    found = {}
    links = structure_of(description, Edits()).links
    for element in description.element.iterfind("link[inertial]"):
        name = element.get("name")
        R = rotation_rpy(np.array(element.find("inertial/origin").get("rpy").split(), dtype=float))
        try:
            found[name] = MassProperties(links[name].mass, np.array(links[name].com), R @ links[name].inertia @ R.T)
        except RobotDynError:
            continue
    return {name: body for name, body in found.items() if np.trace(body.inertia) > 0}


def _kept(description: Description, links: Any) -> Description:
    """The description without the inertials of all links but these: links without a shape are not compared."""
    root = description.element
    for link in root.iterfind("link[inertial]"):
        if link.get("name") not in links:
            link.remove(link.find("inertial"))
    from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

    return check(etree.tostring(root), description.source)


def _length(description: Description) -> float:
    lengths = [float(np.linalg.norm(joint.xyz)) for joint in structure_of(description, Edits()).joints.values()]
    return float(np.median([length for length in lengths if length > 0.02]))


def _of_links(pairs: list[tuple[MassProperties, MassProperties]], length: float) -> dict[str, list[float]]:
    return {
        "mass": [abs(b.mass / a.mass - 1) for a, b in pairs],
        "centre": [float(np.linalg.norm(b.com - a.com)) / length for a, b in pairs],
        "moments": [float(np.linalg.norm(b.inertia - a.inertia) / np.linalg.norm(a.inertia)) for a, b in pairs],
    }


def _of_arm(true: rd.Robot, other: rd.Robot) -> dict[str, list[float]]:
    rng = np.random.default_rng(0)
    q = np.array([true.random_configuration(rng) for _ in range(STATES)])
    N, M = true.N(q), true.M(q)
    diagonal = np.diagonal(M, axis1=-2, axis2=-1)
    D = np.divide(1, np.sqrt(diagonal), out=np.zeros_like(diagonal), where=diagonal > 0)  # 0 of links without a shape
    scale = D[:, :, None] * D[:, None, :]
    off = np.linalg.norm(scale * (other.M(q) - M), axis=(1, 2)) / np.linalg.norm(scale * M, axis=(1, 2))
    return {"gravity": [float(np.abs(other.N(q) - N).max() / np.abs(N).max())], "M": [float(np.median(off))]}


if __name__ == "__main__":
    main()
