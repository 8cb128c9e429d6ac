"""Distributions, figures and samples as texts such as "uniform(low=0, high=3)", of scenes and the command line.

A text is a name with literal arguments. It is parsed, never evaluated.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from inspect import signature
from typing import Any

from robot_dyn.foundations import SweepError, nearest, shorten

_MOST = 10_000  # characters


def called(what: str, text: str, functions: Mapping[str, Callable[..., Any]]) -> Any:
    """Return what a function returns of the literal arguments of a text.

    Args:
        what: Its kind, "distribution", "figure" or "samples".
        text: A call, or a name without arguments.
        functions: By name.

    Raises:
        SweepError: If the text is not a call, its name is unknown, or the arguments are not allowed.
    """
    name, arguments, by_name = _parsed(what, text)
    if name not in functions:
        raise SweepError(f"no {what} {shorten(name)!r}; {nearest(name, functions)}{_ELSE.get(what, '')}")
    function = functions[name]
    try:
        signature(function).bind(*arguments, **by_name)
    except TypeError as error:
        raise SweepError(f"{shorten(text)}: {error}; it is {name}{signature(function)}".replace(": Any", "")) from None
    return function(*arguments, **by_name)


def _parsed(what: str, text: Any) -> tuple[str, list[Any], dict[str, Any]]:
    """Name and arguments of a call."""
    such = _EXAMPLES[what] + _ELSE.get(what, "")
    wrong = SweepError(f"{what}: {shorten(text)!r} is not a name with numbers, such as {such}")
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
_ELSE = {"figure": ", or an import path such as 'my_figures:settling'"}
