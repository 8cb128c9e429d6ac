"""The sweep of a scene; distributions, figures and samples as texts of scenes and the command line.

A text such as "uniform(low=0, high=3)" is a name with literal arguments. It is parsed, never evaluated.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from inspect import signature
from pathlib import Path
from typing import Any

from robot_dyn.foundations import SweepError, nearest, shorten, shown
from robot_dyn.scene import read_both
from robot_dyn.tools.sweeps.distributions import CONSTRUCTORS, Distribution
from robot_dyn.tools.sweeps.folder.samples import RECORDED, Samples, samples
from robot_dyn.tools.sweeps.plan import figures
from robot_dyn.tools.sweeps.plan.figures import Figure, figure
from robot_dyn.tools.sweeps.plan.sweep import Sweep

_MOST = 10_000  # characters
_FIGURES: Mapping[str, Callable[..., Figure]] = {
    name: getattr(figures, name) for name in ("rms_error", "peak", "final")
}


def from_scene(path: str | Path, **changes: Any) -> Sweep:
    """The sweep that a scene states in its table `[sweep]`.

    Args:
        path: Of the scene.
        **changes: Attributes of `Sweep` in place of those that are stated.

    Raises:
        SceneError: If the scene cannot be read.
        SweepError: If it states no sweep, or one that is not allowed.
    """
    stated_table = getattr(read_both(path)[0], "sweep", None)
    table = {} if stated_table is None else stated_table.model_dump(exclude_unset=True)
    vary = {name: distribution_of(text) for name, text in table.pop("vary", {}).items()}
    figures = {name: figure_of(name, text, imports=False) for name, text in table.pop("figures", {}).items()}
    stated = {"vary": vary, "figures": figures} | table
    for name in ("vary", "figures"):
        if not isinstance(more := changes.get(name, {}), Mapping):
            raise SweepError(f"{name}: give them by name, as {{'kp': …}}, got {shown(more)}")
        changes[name] = {**stated.pop(name), **more}
    if "samples" in stated:
        stated["samples"] = samples_of_text(stated["samples"])
    stated |= changes
    if "runs" not in stated:
        raise SweepError(f"{path}: how many runs? give runs=, or a table [sweep] with them")
    return Sweep(str(path), **stated)


def distribution_of(text: str) -> Distribution:
    """The distribution of a text; SweepError if it is not one."""
    return _called("distribution", text, CONSTRUCTORS)


def figure_of(name: str, text: str, imports: bool) -> Figure:
    """The figure of a text, or of an import path, where `imports` allows it.

    Raises:
        SweepError: If it is neither, or an import path in a scene, which holds no code.
    """
    if ":" in text and "(" not in text:
        if not imports:
            raise SweepError(
                f"figures: {name}: {shorten(text)} runs code, and a scene is data; give it in Python or --figure"
            )
        return figure(name, text)
    return _called("figure", text, _FIGURES)


def samples_of_text(text: str) -> Samples:
    """The samples of a text, "q" or "samples('q', every=10)"; SweepError if it is neither."""
    return samples(text) if text in RECORDED else _called("samples", text, {"samples": samples})


def assignment(option: str, text: str) -> tuple[str, str]:
    """Name and value of NAME=VALUE; SweepError if it is not one."""
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise SweepError(f"{option} must be NAME=VALUE, got {shorten(text)!r}")
    return name.strip(), value.strip()


def _called(what: str, text: str, functions: Mapping[str, Callable[..., Any]]) -> Any:
    """What a function returns of the literal arguments of a text."""
    name, arguments, by_name = _parsed(what, text)
    if name not in functions:
        raise SweepError(f"no {what} {shorten(name)!r}; {nearest(name, functions)}")
    function = functions[name]
    try:
        signature(function).bind(*arguments, **by_name)
    except TypeError as error:
        raise SweepError(f"{shorten(text)}: {error}; it is {name}{signature(function)}".replace(": Any", "")) from None
    return function(*arguments, **by_name)


def _parsed(what: str, text: Any) -> tuple[str, list[Any], dict[str, Any]]:
    """Name and arguments of a call."""
    wrong = SweepError(f"{what}: {shorten(text)!r} is not a name with numbers, such as {_EXAMPLES[what]}")
    if not isinstance(text, str) or len(text) > _MOST:
        raise wrong
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        if isinstance(tree, ast.Name):
            return tree.id, [], {}
        if not isinstance(tree, ast.Call) or not isinstance(tree.func, ast.Name):
            raise wrong
        by_name = {str(each.arg): ast.literal_eval(each.value) for each in tree.keywords}
        return tree.func.id, [ast.literal_eval(each) for each in tree.args], by_name
    except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
        raise wrong from None


_EXAMPLES = {
    "distribution": "uniform(low=0, high=3)",
    "figure": "rms_error() or peak('u')",
    "samples": "samples('q', every=10)",
}
