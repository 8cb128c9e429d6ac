"""The specification of a sweep as JSON: all that its rows depend on, and how the folder stores them.

A folder has one, `sweep.json`; another sweep in it is refused with the first difference by name.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal, final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from robot_dyn import Setup
from robot_dyn.codegen import processor_of_code
from robot_dyn.foundations import SweepError, nearest, shorten, shown, version_of
from robot_dyn.simulation import settings_of
from robot_dyn.tools.sweeps import distributions
from robot_dyn.tools.sweeps.designs import MOST_ROWS
from robot_dyn.tools.sweeps.folder.samples import samples
from robot_dyn.tools.sweeps.imported import NOTHING, Named, check_named, digest_of
from robot_dyn.tools.sweeps.plan import figures
from robot_dyn.tools.sweeps.plan.figures import Figure, UserFigure
from robot_dyn.tools.sweeps.plan.stated import StatedScene, stated_scene
from robot_dyn.tools.sweeps.plan.sweep import Sweep, is_scene

FORMAT = 5
_PLACE = "scene"  # where it lies may differ


def versions() -> dict[str, str]:
    """Versions of what the bits of rows depend on."""
    return {name: version_of(name) for name in ("robot-dyn", "numpy", "scipy", "pin", "salib")}


def processor() -> dict[str, str]:
    """Name and features of the processor."""
    name, features = processor_of_code()
    return {"processor": name, "features": ",".join(each[1:] for each in features.split(",") if each.startswith("+"))}


class StoredSamples(BaseModel):
    """Which samples are kept."""

    model_config = ConfigDict(extra="forbid", strict=True)

    names: list[str]
    every: Annotated[int, Field(gt=0)]
    failed: bool


@final
class Specification(BaseModel):
    """What `sweep.json` holds."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    format: Literal[5]
    scene: str
    setup: dict[str, Any]
    runs: Annotated[int, Field(gt=0, le=MOST_ROWS)]
    design: str
    seed: Annotated[int, Field(ge=0)]
    vary: dict[str, dict[str, Any]]
    order: list[str]
    figures: dict[str, dict[str, Any]]
    samples: StoredSamples | None
    versions: dict[str, str]
    rows_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    chunk: Annotated[int, Field(gt=0)]

    @property
    def text(self) -> str:
        """As the file has it."""
        return json.dumps(self.model_dump(), indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    @property
    def digest(self) -> str:
        """SHA-256 of all but where the scene lies."""
        return sha256(json.dumps(self.model_dump(exclude={_PLACE}), sort_keys=True).encode()).hexdigest()

    def check_same(self, other: Specification, where: str, versions: bool = True) -> None:
        """Raise SweepError unless another specification has all that this one states; names the first difference.

        Args:
            other: The specification.
            where: The file of this one, for the message.
            versions: Whether versions of packages are compared too: they matter where rows are computed.
        """
        for name, here, there in _differences(self.model_dump(), other.model_dump(), ""):
            if name != _PLACE and (versions or not name.startswith("versions.")):
                raise SweepError(
                    f"{where}: holds another sweep: {name} is {shorten(here)} there, {shorten(there)} here; give"
                    " another folder, or the sweep that was begun"
                )


def parsed(text: str, where: str) -> Specification:
    """The specification of a text; SweepError with the key and the value if it is not one, or of another format."""
    try:
        data = json.loads(text)
        if isinstance(data, dict) and type(found := data.get("format")) is int and found != FORMAT:
            raise SweepError(
                f"{where}: has format {found}, this version reads {FORMAT}; read it with the version that wrote it, or"
                " run the sweep into a new folder"
            )
        return Specification.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise SweepError(
            f"{where}: is not the specification of a sweep: {key}{': ' * bool(key)}{first['msg']}, got"
            f" {shown(first['input'])}; take that of a copy, or give a new folder"
        ) from None
    except (ValueError, RecursionError):
        raise SweepError(
            f"{where}: is not the specification of a sweep; take that of a copy, or a new folder"
        ) from None


def specification(sweep: Sweep, chunk: int) -> Specification:
    """The specification of a sweep in chunks of so many runs."""
    data = {
        "format": FORMAT,
        "scene": sweep.source,
        "setup": _stated_setup(sweep),
        "runs": int(sweep.runs),
        "design": sweep.points.name,
        "seed": int(sweep.seed),
        "vary": {name: each.to_dict() for name, each in sweep.vary.items()},
        "order": list(sweep.vary),
        "figures": {name: each.to_dict() for name, each in sweep.figures.items()},
        "samples": None if sweep.samples is None else asdict(sweep.samples),
        "versions": versions(),
        "rows_sha256": sha256(np.ascontiguousarray(sweep.points.rows).tobytes()).hexdigest(),
        "chunk": chunk,
    }
    return Specification.model_validate(json.loads(json.dumps(data)))  # as it is read again


def sweep_of(
    stated: Specification, rows: np.ndarray, where: str, named: Named = NOTHING, folder: Path | None = None
) -> Sweep:
    """Return the sweep of a specification, with its scene as it is now.

    Functions that the specification names are imported only if `named` has them too.

    Args:
        stated: The specification.
        rows: Of the design.
        where: Its file, for messages.
        named: What the reader of the folder names.
        folder: The folder, from which nothing is imported.

    Raises:
        SweepError: If it is not one, or is one of another version; if the file of a named function has changed.
    """
    try:
        scene = _scene_of(stated, named, folder)
        vary = {name: distributions.from_dict(stated.vary[name]) for name in stated.order}
        of = {name: _figure_of(name, figure, named, folder) for name, figure in stated.figures.items()}
        if unknown := named.figures.keys() - {name for name, figure in of.items() if isinstance(figure, UserFigure)}:
            raise SweepError(f"{where}: no function is the figure {shown(min(unknown))}; {nearest(min(unknown), of)}")
        design, drawn = (rows, None) if stated.design == "table" else (stated.design, rows)
        kept = stated.samples and samples(
            *stated.samples.names, every=stated.samples.every, failed=stated.samples.failed
        )
        return Sweep(scene, stated.runs, vary, of, design, stated.seed, samples=kept, drawn=drawn)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise SweepError(f"{where}: is not the specification of a sweep ({error!r})") from None


def _scene_of(stated: Specification, named: Named, folder: Path | None) -> str | StatedScene:
    """Return the scene that the reader names or the folder's file; for a function, the stored description."""
    if named.scene is None:
        return stated.scene if is_scene(stated.scene) else stated_scene(stated.scene, stated.setup)
    if not is_scene(named.scene):
        check_named(named.scene, stated.setup.get("function_sha256"), folder)
    return named.scene


def _figure_of(name: str, stored: Mapping[str, Any], named: Named, folder: Path | None) -> Figure:
    """Return a stored figure; for a function that the reader does not name, the stored description."""
    if name not in named.figures:
        return figures.from_dict(stored)
    path = named.figures[name]
    if stored["figure"] != path:
        raise SweepError(f"figures: {name} is {shown(stored['figure'])} in the folder, not {path}")
    check_named(path, stored.get("sha256"), folder)
    return figures.from_dict(stored, may_import=True)


def names_of(sweep: Sweep) -> Named:
    """The scene and functions that a sweep names, for the processes that run it."""
    paths = {name: figure.path for name, figure in sweep.figures.items() if isinstance(figure, UserFigure)}
    return Named(sweep.source, paths)


def _stated_setup(sweep: Sweep) -> dict[str, Any]:
    """Describe the dynamics of a setup; for a function also everything that reading results needs."""
    if isinstance(sweep.scene, StatedScene):
        return dict(sweep.scene.setup)
    stated = _setup(sweep.setup)
    if is_scene(sweep.scene):
        return stated
    facts = {"units": sweep.units, "joint_types": sweep.joint_types, "bytes_expected": sweep.bytes_expected}
    return stated | {"function_sha256": digest_of(sweep.scene)} | facts


def _setup(setup: Setup) -> dict[str, Any]:
    """What a setup integrates, as texts and numbers."""
    robot = getattr(setup.plant.dynamics, "robot", setup.plant.dynamics)
    described = getattr(robot, "description", None)
    file = {} if described is None else {"robot_sha256": sha256(described.text).hexdigest()}
    return {
        "robot": getattr(robot, "name", type(robot).__name__),
        **file,
        "settings": settings_of(setup),
        "q0": setup.q0.tolist(),
        "v0": setup.v0.tolist(),
        "duration_s": setup.duration_s,
        "record_period_s": setup.record_period_s,
        "engine": setup.engine,
    }


def _differences(a: Any, b: Any, name: str) -> Iterator[tuple[str, Any, Any]]:
    """Where two values differ: name, first, second; "—" where there is none."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in dict.fromkeys([*a, *b]):
            yield from _differences(a.get(key, "—"), b.get(key, "—"), f"{name}.{key}" if name else str(key))
    elif a != b:
        yield name, a, b
