"""The options of a robot on the command line: how its file is read. They are the same for every command that takes one.

    @app.command()
    @takes_robot
    def info(robot: Name, options: RobotOptions = AS_STATED, as_json: Json = False): ...

has the fields of `RobotOptions` as options, in place of `options`.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from typing import TYPE_CHECKING, Annotated, Any, final, get_type_hints

import typer

from robot_dyn.cli import arguments, completion
from robot_dyn.cli.application import PackageDir, Xacro
from robot_dyn.foundations.errors import ModelWarning

if TYPE_CHECKING:
    from robot_dyn.model.robot import Robot


@final
@dataclass(frozen=True)
class RobotOptions:
    """How the robot of a command is read, each None unless given.

    With a mass, a total mass or a density, links without inertia get that of their shape.
    """

    lock: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=VALUE",
            help="Lock a joint at a value in rad or m; may be repeated.",
            autocompletion=completion.locks,
        ),
    ] = None
    package_dir: PackageDir = None
    xacro: Xacro = None
    mass: Annotated[
        list[str] | None,
        typer.Option(metavar="LINK=KG", help="Mass of a link without inertia, which its shape gives; may be repeated."),
    ] = None
    total_mass: Annotated[
        float | None,
        typer.Option(metavar="KG", help="Mass of the robot, shared by links without inertia, from shapes."),
    ] = None
    density: Annotated[
        float | None, typer.Option(metavar="KG/M³", help="Density of links without inertia, from shapes.")
    ] = None
    allow_overlap: Annotated[
        bool | None,
        typer.Option("--allow-overlap", help="Count what closed parts of a mesh share as often as they fill it."),
    ] = None
    without: Annotated[
        str | None,
        typer.Option(metavar="WHAT,…", help="What is left out of MJCF: tendon, equality, free, ball."),
    ] = None

    @property
    def given(self) -> dict[str, object]:
        """Value by option."""
        return {f"--{each.name.replace('_', '-')}": getattr(self, each.name) for each in fields(self)}

    def load(self, name: str, *, quiet: bool = False) -> Robot:
        """The robot of a name or path; `quiet` suppresses its warnings."""
        import robot_dyn as rd

        estimated = any(each is not None for each in (self.mass or None, self.total_mass, self.density))
        with warnings.catch_warnings():
            if quiet:
                warnings.simplefilter("ignore", ModelWarning)
            robot = rd.load(
                name,
                package_dirs=self.package_dir or (),
                xacro=None if self.xacro is None else arguments.expansion(self.xacro),
                inertia="from_shapes" if estimated else "stated",
                mass=arguments.assignments("--mass", self.mass, "link") if self.mass else None,
                total_mass=self.total_mass,
                density=self.density,
                allow_overlap=self.allow_overlap or False,
                without={each.strip() for each in (self.without or "").split(",") if each.strip()},
            )
        return robot.with_(lock=arguments.assignments("--lock", self.lock)) if self.lock else robot


AS_STATED = RobotOptions()  # the default of a parameter `options`


def takes_robot(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command in which each field of `RobotOptions` takes the place of the parameter `options`."""
    stated, own = inspect.signature(command).parameters.values(), fields(RobotOptions)
    hints = get_type_hints(command, include_extras=True) | get_type_hints(RobotOptions, include_extras=True)

    @wraps(command)
    def with_options(**given: Any) -> Any:
        options = RobotOptions(**{each.name: given.pop(each.name) for each in own})
        return command(**given, options=options)

    defaults: dict[str, Any] = {}
    for each in stated:
        defaults |= {f.name: f.default for f in own} if each.name == "options" else {each.name: each.default}
    parameters = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=hints[name])
        for name, default in defaults.items()
    ]
    with_options.__signature__ = inspect.Signature(parameters)  # pyright: ignore[reportAttributeAccessIssue]
    with_options.__annotations__ = {name: hints[name] for name in defaults}
    return with_options
