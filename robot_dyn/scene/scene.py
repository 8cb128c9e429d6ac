"""Scene files: read, checked and turned into a Setup. Every number is the file's or a stated default."""

from __future__ import annotations

import os
import re
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ValidationError, WrapValidator

from robot_dyn.effects.effect import Effect
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.errors import RobotDynError, SceneError, nearest, shorten
from robot_dyn.foundations.files import FileKind, read
from robot_dyn.integrate.adaptive import ADAPTIVE, Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.integrate.methods import METHODS, method
from robot_dyn.model.robot import Robot
from robot_dyn.scene.control import Control
from robot_dyn.scene.effects import BY_KIND, Acting, AnyEffect, Edit, bare
from robot_dyn.scene.loading import Loading
from robot_dyn.scene.messages import located, validation_message, where
from robot_dyn.scene.references import AnyReference, Hold, Sampled, ViaPoints
from robot_dyn.scene.schema import NotNegative, Part, PerJoint, PlacedError, Positive, Truth, per_joint, placed
from robot_dyn.scene.tool_tables import with_tool_tables
from robot_dyn.scene.user_effects import Factories, UserEffect, check_factories, user_defined_or
from robot_dyn.simulation.setup.setup import STEP_S, Setup

MAX_BYTES = 2**20
SCENE = FileKind("a scene", ".toml")


class Start(Part):
    """The state at the start; 0 by default."""

    q: PerJoint = 0.0
    """Position."""
    v: PerJoint = 0.0
    """Velocity."""


class Scene(Part):
    """A scene file."""

    robot: str
    """Name of a robot of the catalog, or path of a URDF or MJCF, relative to the folder of the scene."""
    load: Loading = Loading()
    """How its file is read; as it is by default."""
    duration_s: Positive
    """Length of the run."""
    method: str = Setup.integrator
    """Integrator."""
    step_s: Positive = STEP_S
    """Step of a method with a fixed step; shorter where samples, ticks and switches require it."""
    rtol: Positive = Adaptive.rtol
    """Relative tolerance of an adaptive method."""
    atol: Positive = Adaptive.atol
    """Absolute tolerance of an adaptive method, in rad and rad/s (m and m/s for a prismatic joint)."""
    accuracy: Positive | None = None
    """Largest error of q to have, in rad and m, for which pilot runs choose method and tolerance."""
    record_period_s: NotNegative = 0.01
    """Time between samples; 0 for every step."""
    estimate_error: Truth = Setup.estimate_error
    """Whether the run is repeated with longer steps, to estimate its error."""
    engine: Literal["auto", "interpreted", "compiled"] = "auto"
    """Which loop runs; "auto" compiles where that is worthwhile."""
    start: Start = Start()
    """The state at the start."""
    effect: tuple[Annotated[AnyEffect, WrapValidator(user_defined_or)], ...] = ()  # pyright: ignore[reportInvalidTypeForm]
    """What acts, gravity included; nothing by default."""
    control: Control | None = None
    """What drives the joints; nothing by default."""
    reference: AnyReference = Hold(kind="hold")
    """What the controller follows; rest at the start by default."""

    def loaded(self, folder: Path) -> Robot:
        """Return the robot of its file."""
        beside = folder / self.robot
        with placed("robot"):
            return self.load.robot(beside if os.path.isfile(beside) else self.robot)

    def setup(self, folder: Path, about: dict[str, str]) -> Setup:
        """Return the setup it describes; paths are relative to `folder`."""
        loaded = self.loaded(folder)
        robot = bare(loaded)
        for k, effect in enumerate(self.effect):
            if isinstance(effect, Edit):
                with placed("effect", k):
                    robot = effect.edit(robot, loaded)
        acting: list[Effect] = []
        for k, effect in enumerate(self.effect):
            if isinstance(effect, Acting | UserEffect):
                with placed("effect", k):
                    acting += effect.build(robot)
        with placed("start"):
            q0, v0 = (per_joint(name, value, robot) for name, value in (("q", self.start.q), ("v", self.start.v)))
        reference = self.reference
        if isinstance(reference, Sampled | ViaPoints) and reference.file is not None:
            reference = reference.model_copy(update={"file": str(folder / reference.file)})
        with placed("control"):
            controller = None if self.control is None else self.control.build(loaded, robot, q0, reference)
        step_s = self.step_s if "step_s" in self.model_fields_set else None
        return Setup(
            Plant(robot, acting), q0, v0, self.duration_s, controller, self.integrator(),
            step_s, self.record_period_s, self.estimate_error, about, self.engine,
            accuracy=self.accuracy,
        )  # fmt: skip

    def integrator(self) -> Integrator | Adaptive:
        """Return the method by its name."""
        if self.method in ADAPTIVE:
            return Adaptive(self.method, self.rtol, self.atol)
        return method(self.method)


def read_scene(path: str | Path, *, effects: Factories | None = None) -> Setup:
    """Return the setup of a scene file.

    Args:
        path: Path of the file.
        effects: User-defined effects that it may name: a class, or a function that returns an effect, by kind. The
            keys of such a table are its arguments, those of declared coefficients with their unit, as
            "damping_N_m_s_per_rad": numbers, arrays from lists, arrays (n,) from tables by joint.

    Raises:
        SceneError: If the file cannot be read, or a key or value of it is not allowed.
    """
    return read_both(path, {} if effects is None else check_factories(effects, set(BY_KIND)))[1]


def read_both(path: str | Path, effects: Factories | None = None) -> tuple[Scene, Setup]:
    """Return a scene file as it is written, and the setup it describes; SceneError as `read_scene`."""
    data = read(path, MAX_BYTES, SceneError, "see robot-dyn scene for one to start from")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        raise SceneError(f"{path}: is not UTF-8 text; save it as TOML in UTF-8") from None
    scene, table = _parsed(text, str(path), effects)
    try:
        return scene, scene.setup(Path(path).parent, {"scene": text})
    except PlacedError as error:
        named = f"{where(table, error.path)}: {error}" if error.path[0] in ("effect", "start") else str(error)
        raise SceneError(f"{path}: {located(text, error.path, named)}") from None
    except RobotDynError as error:
        raise SceneError(f"{path}: {error}") from None


def parse_scene(text: str, source: str) -> Scene:
    """Return the scene of a TOML text; `source` names it in messages.

    Raises:
        SceneError: If it is not TOML, or a key or value is not allowed.
    """
    return _parsed(text, source)[0]


def _parsed(text: str, source: str, effects: Factories | None = None) -> tuple[Scene, dict[str, Any]]:
    try:
        table = tomllib.loads(text.removeprefix("\ufeff"))  # the mark of some editors for UTF-8
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{source}: {_syntax(error)}; correct the file") from None
    schema = with_tool_tables(Scene, table)
    try:
        scene = schema.model_validate(table, context=dict(effects or {}))
    except ValidationError as error:
        raise SceneError(f"{source}: {validation_message(error, table, text, schema)}") from None
    if scene.control is None and "reference" in scene.model_fields_set:
        message = located(text, ["reference"], "reference: nothing follows it; add a [control]")
        raise SceneError(f"{source}: {message}")
    if scene.method not in METHODS:
        names = nearest(scene.method, METHODS)
        message = located(text, ["method"], f"method: no method {shorten(scene.method)!r}; {names}")
        raise SceneError(f"{source}: {message}")
    if why := _without_effect(scene):
        raise SceneError(f"{source}: {located(text, why.partition(':')[0].split('.'), why)}")
    return scene, table


def _without_effect(scene: Scene) -> str:
    """Return the first statement of a scene without effect on its run; empty if there is none."""
    chosen = [key for key in ("method", "step_s", "rtol", "atol") if key in scene.model_fields_set]
    if scene.accuracy is not None and chosen:
        return f"{chosen[0]}: has no effect, since accuracy chooses method and tolerance; remove one of the two"
    of_other_methods = ("step_s",) if scene.method in ADAPTIVE else ("rtol", "atol")
    if unused := [key for key in of_other_methods if key in scene.model_fields_set]:
        kind = "chooses its own step" if scene.method in ADAPTIVE else "has a fixed step"
        return f"{unused[0]}: has no effect, since {scene.method} {kind}; remove it, or name another method"
    models = [] if scene.control is None else [("control.model.effects", scene.control.model.effects or ())]
    for place, effects in (("effect", scene.effect), *models):
        kinds = [effect.kind for effect in effects]
        for kind in ("gravity", "armature"):
            if kinds.count(kind) > 1:
                return f"{place}: {kind} is named {kinds.count(kind)} times, and only the last would act; keep one"
    return ""


def _syntax(error: Exception) -> str:
    """Return the TOML error, after its place."""
    if isinstance(error, RecursionError):
        return "is not TOML that can be read: its lists or tables are nested too deeply"
    message = shorten(error, 200)
    if place := re.fullmatch(r"(.*) \(at (line \d+, column \d+)\)", message):
        return f"{place[2]}: is not TOML: {place[1]}"
    return f"is not TOML: {message}"
