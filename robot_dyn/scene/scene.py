"""A scene file read, checked and made a Setup: every number is the file's or a stated default."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from robot_dyn.effects.plant import Plant
from robot_dyn.errors import RobotDynError, nearest, shorten
from robot_dyn.files import Kind
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.integrate.methods import METHODS, method
from robot_dyn.model.loading import load
from robot_dyn.model.robot import Robot
from robot_dyn.scene.control import AnyReference, Control, Hold
from robot_dyn.scene.effects import Acting, AnyEffect, Edit
from robot_dyn.scene.schema import NotNegative, Part, PerJoint, Positive, SceneError, Truth, per_joint
from robot_dyn.simulation.setup import Setup

SCENE = Kind("a scene", ".toml")
ADAPTIVE = ("DOP853", "Radau")


class Start(Part):
    """The state at the start; 0 where nothing is said."""

    q: PerJoint = 0.0
    v: PerJoint = 0.0


class Scene(Part):
    """A scene file."""

    robot: str
    duration_s: Positive
    method: str = "DOP853"
    step_s: Positive = 1e-3
    rtol: Positive = 1e-10
    atol: Positive = 1e-12
    record_period_s: NotNegative = 0.01
    estimate_error: Truth = True
    engine: Literal["auto", "interpreted", "compiled"] = "auto"
    start: Start = Start()
    effect: tuple[AnyEffect, ...] = ()
    control: Control | None = None
    reference: AnyReference = Hold(kind="hold")

    def described(self, folder: Path) -> Robot:
        """The robot as its file says, without gravity."""
        beside = folder / self.robot
        return load(beside if beside.is_file() else self.robot).with_(gravity=(0.0, 0.0, 0.0))

    def setup(self, folder: Path, about: dict[str, str]) -> Setup:
        """The setup it describes; paths are relative to `folder`."""
        described = robot = self.described(folder)
        for effect in self.effect:
            if isinstance(effect, Edit):
                robot = effect.edit(robot)
        acting = [part for effect in self.effect if isinstance(effect, Acting) for part in effect.build(robot)]
        q0, v0 = (per_joint(name, value, robot) for name, value in (("q", self.start.q), ("v", self.start.v)))
        controller = None if self.control is None else self.control.build(described, robot, q0, self.reference)
        return Setup(
            Plant(robot, acting), q0, v0, self.duration_s, controller, self.integrator(),
            self.step_s, self.record_period_s, self.estimate_error, about, self.engine,
        )  # fmt: skip

    def integrator(self) -> Integrator | Adaptive:
        """The method by its name."""
        if self.method in ADAPTIVE:
            return Adaptive(self.method, self.rtol, self.atol)
        return method(self.method)


def read_scene(path: str | Path) -> Setup:
    """The setup of a scene file.

    Raises:
        SceneError: If the file cannot be read, or a key or value of it has no meaning.
    """
    return read_both(path)[1]


def read_both(path: str | Path) -> tuple[Scene, Setup]:
    """A scene file as it is written, and the setup it describes; SceneError as `read_scene`."""
    path = Path(path)
    text = _text(path)
    scene = parse_scene(text, str(path))
    try:
        return scene, scene.setup(path.parent, {"scene": text})
    except RobotDynError as error:
        raise SceneError(f"{path}: {error}") from None


def parse_scene(text: str, source: str) -> Scene:
    """A scene of its text; `source` names it in messages.

    Raises:
        SceneError: If it is no TOML, or a key or value has no meaning.
    """
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{source}: is no TOML: {error}; correct the file") from None
    try:
        scene = Scene.model_validate(table)
    except ValidationError as error:
        raise SceneError(f"{source}: {_first(error)}") from None
    if scene.control is None and "reference" in scene.model_fields_set:
        raise SceneError(f"{source}: reference: nothing follows it; add a [control]")
    if scene.method not in (*METHODS, *ADAPTIVE):
        names = nearest(scene.method, (*METHODS, *ADAPTIVE))
        raise SceneError(f"{source}: method: no method {shorten(scene.method)!r}; {names}")
    if why := _without_effect(scene):
        raise SceneError(f"{source}: {why}")
    return scene


def _without_effect(scene: Scene) -> str:
    """What a scene states and no run would heed, or nothing."""
    own = ("step_s",) if scene.method in ADAPTIVE else ("rtol", "atol")
    if unused := [key for key in own if key in scene.model_fields_set]:
        kind = "chooses its own step" if scene.method in ADAPTIVE else "has a fixed step"
        return f"{unused[0]}: has no effect, since {scene.method} {kind}; remove it, or name another method"
    models = [] if scene.control is None else [("control.model.effects", scene.control.model.effects or ())]
    for where, effects in (("effect", scene.effect), *models):
        kinds = [effect.kind for effect in effects]
        for kind in ("gravity", "armature"):
            if kinds.count(kind) > 1:
                return f"{where}: {kind} is named {kinds.count(kind)} times, and only the last would act; keep one"
    return ""


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise SceneError(
            f"{path}: cannot be read ({error.strerror}); see robot-dyn scene for one to start from"
        ) from None
    except UnicodeDecodeError:
        raise SceneError(f"{path}: is no UTF-8 text; save it as TOML") from None


def _keys(part: type[Part]) -> set[str]:
    """All keys that a scene can have."""
    below = (key for sub in part.__subclasses__() for key in _keys(sub))
    return {*part.model_fields, *below}


def _first(error: ValidationError) -> str:
    """The first thing that is wrong: key path, what, value, and the keys there are."""
    found = error.errors(include_url=False)
    unknown = [each for each in found if each["type"] == "extra_forbidden"]
    first = (unknown or found)[0]
    tags = {"float", "list[float]", "dict[str,float]", "literal['urdf']"}
    where = [str(part) for part in first["loc"] if not (isinstance(part, str) and part in tags)]
    path = "".join(f"[{part}]" if part.isdigit() else f".{part}" for part in where).lstrip(".")
    value: Any = first.get("input")
    if first["type"] == "extra_forbidden":
        return f"{path}: unknown key with value {shorten(repr(value))}; {nearest(where[-1], _keys(Part))}"
    return f"{path}: {first['msg'].lower()}, got {shorten(repr(value))}"
