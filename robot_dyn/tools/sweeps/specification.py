"""The specification of a sweep as JSON: everything that its rows depend on, and their storage.

A folder has one specification, `sweep.json`; another sweep in it is an error that names the first difference.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal, final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from robot_dyn import Setup
from robot_dyn.codegen import processor_of_code
from robot_dyn.foundations import SweepError, nearest, read, shorten, shown, version_of
from robot_dyn.simulation import settings_of
from robot_dyn.tools.sweeps import distributions, figures
from robot_dyn.tools.sweeps.designs import MOST_ROWS
from robot_dyn.tools.sweeps.figures import UserFigure
from robot_dyn.tools.sweeps.imported import NONE_NAMED, Named, check_named, digest_of, is_scene
from robot_dyn.tools.sweeps.kept_samples import Samples
from robot_dyn.tools.sweeps.sweep import Sweep

FILE = "sweep.json"
FORMAT = 7
_MOST_BYTES = 2**26
_NONE = "start a sweep with robot-dyn sweep SCENE.toml … -o FOLDER"
_PLACE = "scene"  # its path may differ


def versions() -> dict[str, str]:
    """Return the versions of packages that the bits of rows depend on."""
    return {name: version_of(name) for name in ("robot-dyn", "numpy", "scipy", "pin", "salib")}


def processor() -> dict[str, str]:
    """Return name and features of the processor, and "bits" if its machine code is portable."""
    name, features, *bits = processor_of_code()
    enabled = ",".join(text[1:] for text in features.split(",") if text.startswith("+"))
    return {"processor": name, "features": enabled} | ({"bits": bits[0]} if bits else {})


class _SetupOfFunction(BaseModel):
    """Data about the setup of a function, with which results can be read without calling the function."""

    model_config = ConfigDict(strict=True)

    units: dict[str, str]
    joint_types: list[str | None]
    bytes_expected: int


@final
class Specification(BaseModel):
    """The content of `sweep.json`."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    format: Literal[7]
    scene: str
    setup: dict[str, Any]
    runs: Annotated[int, Field(gt=0, le=MOST_ROWS)]
    design: str
    seed: Annotated[int, Field(ge=0)]
    vary: dict[str, dict[str, Any]]
    order: list[str]
    figures: dict[str, dict[str, Any]]
    samples: Samples | None
    uncut: bool
    versions: dict[str, str]
    rows_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    chunk: Annotated[int, Field(gt=0)]

    @property
    def text(self) -> str:
        """Text of the file."""
        return json.dumps(self.model_dump(), indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    @property
    def digest(self) -> str:
        """SHA-256 of everything except the path of the scene."""
        return sha256(json.dumps(self.model_dump(exclude={_PLACE}), sort_keys=True).encode()).hexdigest()

    def check_same(self, other: Specification, folder: Path, versions: bool = True) -> None:
        """Raise a SweepError that names the first difference unless two specifications agree.

        Args:
            other: The other specification.
            folder: Folder of this specification, for the message.
            versions: True to compare versions of packages, too: they matter if rows are computed.
        """
        for name, here, there in _differences(self.model_dump(), other.model_dump(), ""):
            if name != _PLACE and (versions or not name.startswith("versions.")):
                raise SweepError(
                    f"{folder / FILE}: contains another sweep: {name} is {shorten(here)} there, {shorten(there)} here;"
                    " give another folder, or the same sweep"
                )

    def sweep(self, rows: np.ndarray, folder: Path, named: Named = NONE_NAMED) -> Sweep:
        """Return the sweep, with the present content of its scene.

        Functions in the specification are imported only if `named` has them, too.

        Args:
            rows: Rows of the design.
            folder: The folder; nothing is imported from it.
            named: Scene and functions that the reader of the folder names.

        Raises:
            SweepError: If the specification is invalid, or the file of a named function has changed.
        """
        try:
            scene, stated = named.scene or self.scene, None
            if named.scene is None and not is_scene(scene):
                stated = self.setup
                _SetupOfFunction.model_validate(stated)
            elif not is_scene(scene):
                check_named(scene, self.setup.get("function_sha256"), folder)
            for name, path in named.figures:
                kind = self.figures.get(name, {}).get("figure")
                if kind != path:
                    raise SweepError(
                        f"{folder}: the figure {name} is {shown(kind)}, not {path}; {nearest(name, self.figures)}"
                    )
                check_named(path, self.figures[name].get("sha256"), folder)
            vary = {name: distributions.from_dict(self.vary[name]) for name in self.order}
            sweep_figures = {
                name: figures.from_dict(x, name in dict(named.figures)) for name, x in self.figures.items()
            }
            design, drawn = (rows, None) if self.design == "table" else (self.design, rows)
            return Sweep(
                scene,
                self.runs,
                vary,
                sweep_figures,
                design,
                self.seed,
                self.samples,
                uncut=self.uncut,
                drawn=drawn,
                stated=stated,
            )
        except (KeyError, TypeError, AttributeError, ValueError) as error:
            raise SweepError(f"{folder / FILE}: is not the specification of a sweep ({error!r})") from None


def stated_in(folder: Path) -> Specification:
    """Return the specification in a folder; raise a SweepError if it is missing, invalid or of another format."""
    path = folder / FILE
    try:
        return Specification.model_validate_json(read(path, _MOST_BYTES, SweepError, _NONE))
    except ValidationError as error:
        first = error.errors()[0]
    key, got = ".".join(map(str, first["loc"])), first["input"]
    if key == "format" and isinstance(got, int):
        raise SweepError(
            f"{path}: has format {got}, but this version reads {FORMAT}; read it with the version that wrote it, or"
            " run the sweep into a new folder"
        )
    raise SweepError(
        f"{path}: is not the specification of a sweep: {key}{': ' * bool(key)}{first['msg']}, got {shown(got)};"
        " restore it from a copy, or give a new folder"
    )


def specification(sweep: Sweep, chunk: int) -> Specification:
    """Return the specification of a sweep with `chunk` runs per file."""
    data = {
        "format": FORMAT,
        "scene": sweep.scene,
        "setup": _setup(sweep),
        "runs": int(sweep.runs),
        "design": sweep.points.name,
        "seed": int(sweep.seed),
        "vary": {name: distribution.to_dict() for name, distribution in sweep.vary.items()},
        "order": list(sweep.vary),
        "figures": {name: figure.to_dict() for name, figure in sweep.figures.items()},
        "samples": None if sweep.samples is None else asdict(sweep.samples),
        "uncut": sweep.uncut,
        "versions": versions(),
        "rows_sha256": sha256(np.ascontiguousarray(sweep.points.rows).tobytes()).hexdigest(),
        "chunk": chunk,
    }
    return Specification.model_validate_json(json.dumps(data))  # equal to the specification read from the file


def names_of(sweep: Sweep) -> Named:
    """Return the scene and functions that a sweep names, for the processes that run it."""
    functions = {name: figure for name, figure in sweep.figures.items() if isinstance(figure, UserFigure)}
    return Named(sweep.scene, tuple((name, figure.path) for name, figure in functions.items()))


def _setup(sweep: Sweep) -> dict[str, Any]:
    """Return the setup of a sweep as texts and numbers; for a function, also the data needed to read results."""
    if sweep.stated is not None:
        return dict(sweep.stated)
    setup: Setup = sweep.setup
    robot = getattr(setup.plant.dynamics, "robot", setup.plant.dynamics)
    described = getattr(robot, "description", None)
    stated = {
        "robot": getattr(robot, "name", type(robot).__name__),
        **({} if described is None else {"robot_sha256": sha256(described.text).hexdigest()}),
        "settings": settings_of(setup),
        "q0": setup.q0.tolist(),
        "v0": setup.v0.tolist(),
        "duration_s": setup.duration_s,
        "record_every_s": setup.record_every_s,
        "engine": setup.engine,
    }
    if is_scene(sweep.scene):
        return stated
    facts = _SetupOfFunction(
        units=sweep.units, joint_types=list(sweep.joint_types), bytes_expected=sweep.bytes_expected
    )
    return stated | {"function_sha256": digest_of(sweep.scene)} | facts.model_dump()


def _differences(a: Any, b: Any, name: str) -> Iterator[tuple[str, Any, Any]]:
    """Yield name, first and second value of each difference; "—" for a missing value."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in dict.fromkeys([*a, *b]):
            yield from _differences(a.get(key, "—"), b.get(key, "—"), f"{name}.{key}" if name else str(key))
    elif a != b:
        yield name, a, b
