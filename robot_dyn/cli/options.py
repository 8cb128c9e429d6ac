"""Options of commands, described by their docstrings, and groups of options that commands share.

    @command("Verification")
    def certify(robot: Name, /, samples: int = 10_000, options: RobotOptions = AS_STATED, results: Results = PRINTED):
        # its docstring has a line "samples (COUNT): Number of random states."

has the argument ROBOT, the option `--samples COUNT`, and the fields of `RobotOptions` and of `Results` as options.
"""

from __future__ import annotations

import inspect
import os
import re
import warnings
from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import dataclass, fields, is_dataclass
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, final, get_args, get_origin, get_type_hints

import typer

from robot_dyn.cli import arguments, completion
from robot_dyn.cli.terminal import show
from robot_dyn.foundations.errors import ModelWarning, QueryError
from robot_dyn.foundations.files import target

if TYPE_CHECKING:
    from robot_dyn.description.edits import Changes
    from robot_dyn.model.robot import Robot

Name = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="A name of `robot-dyn list`, or the path of a URDF or MJCF file.",
        autocompletion=completion.robots,
    ),
]
Dark = Annotated[bool, typer.Option("--dark", help="Draw for dark screens.")]
Budget = Annotated[float, typer.Option(metavar="SECONDS", help="Time to spend, without compiling.")]
Repeats = Annotated[int, typer.Option(min=1, help="Largest number of timings of each, within the budget.")]
Scene = Annotated[str, typer.Argument(metavar="SCENE.toml", help="A scene file; `robot-dyn scene` prints some.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite existing files.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, as documented in docs/reference/json.md.")]
Positions = Annotated[str | None, typer.Option(help="Positions in rad or m: 0.1,-0.2,… or joint=0.1,…; 0 by default.")]
Effects = Annotated[str | None, typer.Option(help='"urdf" adds the friction that the file states.')]
Payloads = Annotated[
    list[str] | None,
    typer.Option(
        metavar="LINK=MASS@X,Y,Z", help="Add a body to a link, such as tool0=5kg@0,0,0.1 (m); may be repeated."
    ),
]


@dataclass(frozen=True)
class FileOptions:
    """Options for reading a URDF or MJCF file; None where absent.

    With a mass, a total mass or a density, inertias of links without one are estimated from their shapes.

    Options:
        package_dir: Folder in which ROS packages are searched; may be repeated.
        xacro (NAME=VALUE): Expand a xacro file, which runs its expressions; may be repeated; '' for no argument.
        mass (LINK=KG): Mass of a link without inertia; its shape gives the inertia; may be repeated.
        total_mass (KG): Mass of the robot, shared among links without inertia by their shapes.
        density (KG/M³): Density of links without inertia.
        allow_overlap: Count the volume that closed parts of a mesh share once for each part.
    """

    package_dir: list[str] | None = None
    xacro: list[str] | None = None
    mass: list[str] | None = None
    total_mass: float | None = None
    density: float | None = None
    allow_overlap: bool = False

    @property
    def stated(self) -> dict[str, object]:
        """Values of the options that are given, by name."""
        values = {field: getattr(self, field.name) for field in fields(self)}
        stated = {field.name: value for field, value in values.items() if value not in (field.default, [])}
        return {f"--{name.replace('_', '-')}": value for name, value in stated.items()}

    @property
    def reading(self) -> dict[str, Any]:
        """Arguments of the functions that read a file."""
        return {
            "package_dirs": self.package_dir or (),
            "xacro": None if self.xacro is None else arguments.pairs("--xacro", list(filter(None, self.xacro))),
            "mass": arguments.assignments("--mass", self.mass, "link") if self.mass else None,
            "total_mass": self.total_mass,
            "density": self.density,
            "allow_overlap": self.allow_overlap,
        }


@final
@dataclass(frozen=True)
class RobotOptions(FileOptions):
    """Options for reading the robot of a command; None where absent.

    Options:
        lock (JOINT=VALUE): Lock a joint at a value in rad or m; may be repeated.
        without (PART,…): Parts of an MJCF file to omit: tendon, equality, free, ball.
        gravity (X,Y,Z): Gravity in base axes, in m/s²; 0,0,9.81 on a ceiling.
    """

    lock: Annotated[list[str] | None, typer.Option(autocompletion=completion.locks)] = None
    without: str | None = None
    gravity: str | None = None

    def load(self, name: str, *, quiet: bool = False) -> Robot:
        """Return the robot of a name or path; `quiet` suppresses its warnings."""
        import robot_dyn as rd

        estimated = {"--mass", "--total-mass", "--density"} & self.stated.keys()
        without = {part.strip() for part in (self.without or "").split(",") if part.strip()}
        with warnings.catch_warnings():
            if quiet:
                warnings.simplefilter("ignore", ModelWarning)
            inertia = "from_shapes" if estimated else "stated"
            robot = rd.load(name, inertia=inertia, without=without, **self.reading)
        changes: Changes = {}
        if self.gravity is not None:
            changes["gravity"] = arguments.vector("--gravity", self.gravity, ("x", "y", "z"))
        if self.lock:
            changes["lock"] = arguments.assignments("--lock", self.lock)
        return robot.with_(**changes) if changes else robot


@final
@dataclass(frozen=True)
class Results:
    """Options for the result of a command: a figure, a table, text or JSON.

    Options:
        output (PLOT.png): Write the figure (.png, .svg, .pdf) or a page (.html).
        csv (TABLE.csv): Write the rows as a CSV table.
    """

    output: str | None = None
    csv: str | None = None
    dark: Dark = False
    force: Force = False
    as_json: Json = False

    def files(self, result_type: type, *inputs: str | None) -> list[Path]:
        """Check, before any work, the paths of the figure and the table of a class of results; return them."""
        from robot_dyn.report.figure import ResultError
        from robot_dyn.report.result import REPORT, table_kind
        from robot_dyn.view.plots.pictures import PICTURES

        if self.dark and not self.output:
            raise QueryError("--dark applies to figures only; add --output PLOT.png, or remove --dark")
        read, paths = [path for path in inputs if path and os.path.isfile(path)], []
        for path, kinds in ((self.output, (*PICTURES, REPORT)), (self.csv, table_kind(result_type))):
            if path:
                paths.append(target(path, kinds, ResultError, [*read, *paths], self.force))
        return paths

    def give(self, result: Any, paths: Iterable[Path], drawn: Any = None, first: str = "", **more: Any) -> None:
        """Write a result, or `drawn` instead, and print it after a first line, with more answers by key."""
        theme = "dark" if self.dark else "light"
        writes = [partial((drawn or result).save, path, theme=theme) for path in paths]
        show([first, "", result] if first else result, document=result, as_json=self.as_json, more=more, writes=writes)


FILE_AS_STATED, AS_STATED = FileOptions(), RobotOptions()  # defaults of the parameters of commands
PRINTED = Results()


_DESCRIBED = re.compile(r"^    (\w+)(?: \(([^)]+)\))?: (.+(?:\n {5,}.+)*)", re.MULTILINE)
_SHORT = {"output": ("-o",)}


def with_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function for typer, with keywords only: options have descriptions, and groups become their fields.

    Parameters before `/` are arguments. A line "name (VALUE): text" in a docstring describes a parameter or field.
    """
    stated, groups, parameters = inspect.signature(function).parameters.values(), dict[str, Any](), []
    arguments = [parameter.name for parameter in stated if parameter.kind is parameter.POSITIONAL_ONLY]
    for parameter in stated:
        if is_dataclass(kind := type(parameter.default)):
            groups[parameter.name] = kind
            options = [parameter.replace(name=field.name, default=field.default) for field in fields(kind)]
            parameters += [_described(option, *reversed(kind.__mro__)) for option in options]
        else:
            parameters.append(_described(parameter, function))

    @wraps(function)
    def replaced(**given: Any) -> Any:
        for name, kind in groups.items():
            given[name] = kind(**{field.name: given.pop(field.name) for field in fields(kind)})
        values = [given.pop(name) for name in arguments]
        return function(*values, **given)

    replaced.__signature__ = inspect.Signature(parameters)  # pyright: ignore[reportAttributeAccessIssue]
    replaced.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    paragraphs = inspect.cleandoc(function.__doc__ or "").partition("\n\nOptions:")[0].split("\n\n")
    replaced.__doc__ = "\n\n".join(" ".join(text.split()) for text in paragraphs)  # the terminal breaks lines
    return replaced


def _described(parameter: inspect.Parameter, *where: Any) -> inspect.Parameter:
    """Return a parameter for typer, with its description in the docstrings of a function or of classes."""
    name, default = parameter.name, parameter.default
    annotation = get_type_hints(where[-1], include_extras=True)[name]
    docstrings = "\n".join(inspect.cleandoc(source.__doc__ or "") for source in where)
    texts = {name: (form, " ".join(text.split())) for name, form, text in _DESCRIBED.findall(docstrings)}
    kind, *stated = get_args(annotation) if get_origin(annotation) is Annotated else (annotation,)
    is_argument = parameter.kind is parameter.POSITIONAL_ONLY
    info = copy(stated[0]) if stated else typer.Argument() if is_argument else typer.Option()
    named = isinstance(info.default, str)  # where typer keeps the name of Option("--json")
    if not (named or is_argument or default is True):  # typer itself adds --no-… where that is the default
        info.param_decls = (*_SHORT.get(name, ()), f"--{name.strip('_').replace('_', '-')}")
    if name in texts:  # none under python -OO
        form, info.help = texts[name]
        info.metavar = form or None
    return parameter.replace(kind=parameter.KEYWORD_ONLY, annotation=Annotated[kind, info])
