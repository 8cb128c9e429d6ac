"""Scene files: read, checked and turned into a Setup. Every number comes from the file or is a documented default."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, ValidationError, create_model, model_validator

from robot_dyn.effects.effect import Effect
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.errors import RobotDynError, SceneError, nearest, shorten, shown
from robot_dyn.foundations.files import FileKind, read
from robot_dyn.integrate.adaptive import ADAPTIVE, AUTO, Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.integrate.methods import METHODS, method
from robot_dyn.model.loading import load
from robot_dyn.model.robot import Robot
from robot_dyn.scene.control import Control
from robot_dyn.scene.declared import callable_part
from robot_dyn.scene.effects import ACTING, BY_KIND, EDITS, AnyEffect, DeclaredEffect, Edit, bare
from robot_dyn.scene.messages import line, named_part, part, validation_message
from robot_dyn.scene.references import AnyReference, Circle, Hold, Line, Sampled, ViaPoints
from robot_dyn.scene.schema import NotNegative, Part, PerJoint, Positive, Truth, Vector3, one_of, per_joint, wrong_key
from robot_dyn.simulation.results.run_file import RUN
from robot_dyn.simulation.setup.setup import STEP_S, Setup

Factories = Mapping[str, Callable[..., Effect]]
MAX_BYTES = 2**20
_OF_SETUP = {"controller": "control", "period_s": "control", "q0": "start", "v0": "start"}
SCENE = FileKind("a scene", ".toml")


class Loading(Part):
    """Options for reading the file of the robot. The summary of a run lists estimated values and omitted parts."""

    inertia: Literal["stated", "from_shapes"] = "stated"
    """Inertias as in the file; "from_shapes" estimates missing ones from the shapes of links, including meshes."""
    mass_kg: dict[str, Positive] | None = None
    """With "from_shapes": masses by link."""
    total_mass_kg: Positive | None = None
    """With "from_shapes": mass of the whole robot; links without a mass share the remainder by volume."""
    density_kg_per_m3: Positive | None = None
    """With "from_shapes", instead of `total_mass_kg`: density of links without a mass."""
    allow_overlap: bool = False
    """With "from_shapes": count overlaps of closed parts of a mesh several times; otherwise they are errors."""
    without: tuple[Literal["tendon", "equality", "free", "ball"], ...] = ()
    """Parts of an MJCF file to omit."""

    def robot(self, name_or_path: str | Path) -> Robot:
        """Return the robot of a name or path."""
        return load(
            name_or_path, inertia=self.inertia, mass=self.mass_kg, total_mass=self.total_mass_kg,
            density=self.density_kg_per_m3, allow_overlap=self.allow_overlap, without=self.without,
        )  # fmt: skip


class Attachment(Part):
    """A gripper or rigid tool fastened to a link of the arm."""

    robot: str
    """Name of a robot of the catalog, or path of a URDF or MJCF, relative to the folder of the scene."""
    frame: str
    """Link of the arm that carries it."""
    prefix: str = ""
    """Prefix of the names of its links and joints."""
    xyz_m: Vector3 = (0.0, 0.0, 0.0)
    """Position of its root in the frame."""
    rpy_rad: Vector3 = (0.0, 0.0, 0.0)
    """Orientation of its root in the frame: roll, pitch and yaw, as in a URDF."""
    load: Loading = Loading()
    """Options for reading its file."""

    def attach(self, arm: Robot, path: str | Path) -> Robot:
        """Return the arm with the gripper of a file; without options for reading, it needs no moving joint."""
        gripper = self.load.robot(path) if self.load != Loading() else path
        return arm.attach(gripper, frame=self.frame, prefix=self.prefix, xyz=self.xyz_m, rpy=self.rpy_rad)


class Start(Part):
    """The state at the start; 0 by default."""

    q: PerJoint = 0.0
    """Position, in rad, or m for a prismatic joint."""
    v: PerJoint = 0.0
    """Velocity, in rad/s, or m/s for a prismatic joint."""


def _known_method(name: str) -> str:
    if name not in METHODS:
        raise ValueError(f"no method {shorten(name)!r}; {nearest(name, METHODS)}")
    return name


class Scene(Part):
    """A scene file."""

    robot: str
    """Name of a robot of the catalog, or path of a URDF or MJCF, relative to the folder of the scene."""
    load: Loading = Loading()
    """Options for reading the robot's file; unchanged by default."""
    attach: tuple[Attachment, ...] = ()
    """Grippers on the arm; none by default."""
    duration_s: Positive
    """Length of the run."""
    method: Annotated[str, AfterValidator(_known_method)] = AUTO
    """Integration method."""
    step_s: Positive = STEP_S
    """Step of a method with a fixed step; shorter where samples, ticks and switches require it."""
    rtol: Positive = Adaptive.rtol
    """Relative tolerance of an adaptive method."""
    atol: Positive = Adaptive.atol
    """Absolute tolerance of an adaptive method, in rad and rad/s (m and m/s for a prismatic joint)."""
    accuracy: Positive | None = None
    """Largest error of q, in rad and m; pilot runs choose method and tolerance for it."""
    record_every_s: NotNegative = 0.01
    """Time between samples; 0 for every step."""
    estimate_error: Truth = Setup.estimate_error
    """True to repeat the run with longer steps, which estimates its error."""
    engine: Literal["auto", "interpreted", "compiled"] = "auto"
    """Engine of the run; "auto" compiles if that saves time."""
    start: Start = Start()
    """The state at the start."""
    effect: tuple[AnyEffect, ...] = ()  # pyright: ignore[reportInvalidTypeForm]
    """The effects, gravity included; none by default."""
    control: Control | None = None
    """The controller; none by default."""
    reference: AnyReference = Hold(kind="hold")  # pyright: ignore[reportInvalidTypeForm]
    """The reference of the controller; rest at the start by default."""

    @classmethod
    def valid_keys(cls) -> tuple[str, ...]:
        """Return the keys of a scene, including tables of tools."""
        return (*super().valid_keys(), *tool_tables())

    @model_validator(mode="after")
    def _every_key_has_an_effect(self) -> Self:
        stated = self.model_fields_set
        if self.control is None and "reference" in stated:
            raise wrong_key("reference", "has no effect without a controller; add [control]")
        chosen = [key for key in ("method", "step_s", "rtol", "atol") if key in stated]
        if self.accuracy is not None and chosen:
            raise wrong_key(
                chosen[0], "has no effect because accuracy chooses method and tolerance; remove one of the two"
            )
        of_other_methods = ("step_s",) if self.method in ADAPTIVE else ("rtol", "atol")
        if unused := [key for key in of_other_methods if key in stated]:
            kind = "chooses its own step" if self.method in ADAPTIVE else "has a fixed step"
            raise wrong_key(unused[0], f"has no effect because {self.method} {kind}; remove it, or name another method")
        if self.control is not None:
            kind, of_frame = self.control.kind, self.control.kind == "operational_space"
            if of_frame != isinstance(self.reference, Line | Circle):
                need = "line or circle" if of_frame else "hold, quintic, via_points or samples"
                raise wrong_key("reference.kind", f"{kind} follows {need}, got {self.reference.kind!r}")
            if of_frame and self.control.frame is None:
                raise wrong_key("control.frame", "is missing; name the link that follows the line or circle")
        model_effects = None if self.control is None else self.control.model.effects
        for place, effects in (("effect", self.effect), ("control.model.effects", model_effects or ())):
            kinds = [effect.kind for effect in effects]
            for kind in ("gravity", "armature"):
                if (count := kinds.count(kind)) > 1:
                    raise wrong_key(place, f"{kind} appears {count} times, but only the last would act; keep one")
        return self

    def setup(self, folder: Path, metadata: dict[str, str]) -> Setup:
        """Return the setup of the scene; paths are relative to `folder`."""
        with part("robot"):
            loaded = self.load.robot(_path_or_name(folder, self.robot))
        for k, gripper in enumerate(self.attach):
            with part("attach", k):
                loaded = gripper.attach(loaded, _path_or_name(folder, gripper.robot))
        robot = bare(loaded)
        acting: list[Effect] = []
        paths: dict[str, tuple[str | int, ...]] = {}  # by the words of messages that stand for them
        for k, effect in sorted(enumerate(self.effect), key=lambda pair: not isinstance(pair[1], Edit)):  # edits first
            with part("effect", k):
                try:
                    if isinstance(effect, Edit):
                        robot = effect.edit(robot, loaded)
                    else:
                        built = effect.build(robot)
                        acting += built
                        paths |= {one.name: ("effect", k) for one in built if one.name not in paths}
                except RobotDynError as error:
                    message = str(error).removeprefix(f"{effect.kind}: ")
                    raise SceneError(f"effect {k + 1} ({effect.kind}): {message}") from None
        with part("start"):
            q0, v0 = (per_joint(f"start.{key}", getattr(self.start, key), robot) for key in ("q", "v"))
        reference = self.reference
        if isinstance(reference, Sampled | ViaPoints) and reference.file is not None:
            reference = reference.model_copy(update={"file": str(folder / reference.file)})
        with part("control"):
            controller = None if self.control is None else self.control.build(loaded, robot, q0, reference)
        step_s = self.step_s if "step_s" in self.model_fields_set else None
        words = _OF_SETUP | {key: key for key in type(self).model_fields}
        paths |= {word: (key,) for word, key in words.items() if key in self.model_fields_set}
        with named_part(paths, [effect.kind for effect in self.effect]):
            return Setup(
                Plant(robot, acting),
                q0,
                v0,
                duration_s=self.duration_s,
                controller=controller,
                method=self.built_method(),
                step_s=step_s,
                record_every_s=self.record_every_s,
                estimate_error=self.estimate_error,
                metadata=metadata,
                engine=self.engine,
                accuracy=self.accuracy,
            )

    def built_method(self) -> Integrator | Adaptive:
        """Return the integration method with the name `method`, with the tolerances of the scene if it is adaptive."""
        if self.method in ADAPTIVE:
            return Adaptive(self.method, self.rtol, self.atol)
        return method(self.method)


def _path_or_name(folder: Path, robot: str) -> Path | str:
    """Return the path of a robot's file relative to the folder of the scene, or its name if there is no such file."""
    return file if os.path.isfile(file := folder / robot) else robot


def tool_tables() -> dict[str, EntryPoint]:
    """Return the entry points of tables of tools, such as [sweep], by name; they are imported if a scene has them."""
    return {entry.name: entry for entry in entry_points(group="robot_dyn.scene_tables")}


def read_scene(path: str | Path, *, effects: Factories | None = None) -> Setup:
    """Return the setup of a scene file.

    Args:
        path: Path of the file.
        effects: User-defined effects for the scene: a class, or a function that returns an effect, by kind. The keys
            of its table are the arguments, declared coefficients with their unit, such as "viscous_N_m_s_per_rad";
            values are numbers, arrays from lists, or arrays (n,) from tables by joint.

    Raises:
        SceneError: If the file cannot be read, or a key or value is invalid.
    """
    return read_both(path, effects)[1]


def read_both(path: str | Path, effects: Factories | None = None) -> tuple[Scene, Setup]:
    """Return a scene as written, and the setup it describes; for errors, see `read_scene`."""
    data = read(path, MAX_BYTES, SceneError, "run robot-dyn scene for a scene to start from")
    if data.startswith(RUN.start):
        raise SceneError(f"{path}: is a run file or another archive, not a scene; robot-dyn replay shows a run file")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        raise SceneError(
            f"{path}: is not UTF-8 text; a scene is a TOML file in UTF-8: `robot-dyn scene` prints one"
        ) from None
    scene = parse_scene(text, str(path), effects)
    try:
        return scene, scene.setup(Path(path).parent, {"scene": text})
    except RobotDynError as error:
        place = line(text, scene.model_fields_set, vars(error).get("part", ()))
        raise SceneError(f"{path}: {place}{error}") from None


def parse_scene(text: str, source: str, effects: Factories | None = None) -> Scene:
    """Return the scene of a TOML text; `source` names it in messages.

    Raises:
        SceneError: If the text is not TOML, or a key or value is invalid.
    """
    try:
        table = tomllib.loads(text.removeprefix("\ufeff"))  # some editors write a byte-order mark
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{source}: {_syntax(error)}; correct the file") from None
    tables = tool_tables()
    used: Any = {key: (tables[key].load() | None, None) for key in table if key in tables}
    if effects is not None:
        parts = [callable_part(DeclaredEffect, kind, effects[kind]) for kind in _user_kinds(effects)]
        used["effect"] = (tuple[one_of(*EDITS, *ACTING, *parts), ...], ())
    schema = create_model("Scene", __base__=Scene, **used) if used else Scene
    try:
        return schema.model_validate(table)
    except ValidationError as error:
        raise SceneError(f"{source}: {validation_message(error, table, text)}") from None


def _user_kinds(effects: Any) -> Iterable[str]:
    """Return the kinds of user-defined effects; raise a SceneError if one is not callable, or its kind is taken."""
    if not isinstance(effects, Mapping) or not all(
        isinstance(kind, str) and callable(effects[kind]) for kind in effects
    ):
        example = "{'stribeck': Stribeck}"
        raise SceneError(f"effects: give classes of effects by kind, such as {example}, got {shown(effects)}")
    if both := BY_KIND.keys() & effects.keys():
        raise SceneError(f"effects: the kind {min(both)!r} exists already; choose another name")
    return effects.keys()


def _syntax(error: Exception) -> str:
    """Return the message of a TOML error, with its place first."""
    if isinstance(error, RecursionError):
        return "is not readable TOML: lists or tables are nested too deeply"
    message = shorten(error, 200)
    if place := re.fullmatch(r"(.*) \(at (line \d+, column \d+)\)", message):
        return f"{place[2]}: is not valid TOML: {place[1]}"
    return f"is not valid TOML: {message}"
