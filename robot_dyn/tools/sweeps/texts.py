"""Distributions, figures and samples written as text, as in scenes and on the command line.

A text is a name, or a call with literal arguments, for example "uniform(low=0, high=3)". It is parsed, never evaluated.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter, signature
from typing import TypeVar

from robot_dyn.foundations import SweepError, nearest, shorten, shown

Result = TypeVar("Result")
_MOST = 10_000  # largest number of characters of a text
_EXAMPLES = {
    "distribution": "uniform(low=0, high=3)",
    "figure": "rms_tracking_error() or peak('u'), or an import path such as 'my_figures:settling'",
    "samples": "samples('q', every=10)",
}


def called(kind: str, text: object, functions: Mapping[str, Callable[..., Result]]) -> Result:
    """Call a function with the literal arguments of a text, and return its result.

    Args:
        kind: Kind of the text, "distribution", "figure" or "samples".
        text: A call, or a name without arguments.
        functions: Functions by name.

    Raises:
        SweepError: If the text is not a call, its name is unknown, or the arguments are invalid.
    """
    wrong = SweepError(f"{kind}: {shorten(text)!r} is not a name with arguments, for example {_EXAMPLES[kind]}")
    if not isinstance(text, str) or len(text) > _MOST:
        raise wrong
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        call = tree if isinstance(tree, ast.Call) else ast.Call(tree, [], [])
        arguments = [ast.literal_eval(x) for x in call.args]
        by_name = {str(keyword.arg): ast.literal_eval(keyword.value) for keyword in call.keywords}
    except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
        raise wrong from None
    if not isinstance(call.func, ast.Name):
        raise wrong
    return call_of(kind, call.func.id, functions, arguments, by_name)


def call_of(
    kind: str,
    name: str,
    functions: Mapping[str, Callable[..., Result]],
    arguments: Sequence[object],
    by_name: Mapping[str, object],
) -> Result:
    """Call a function by name; raise a SweepError if it is unknown or does not accept the arguments."""
    if name not in functions:
        raise SweepError(f"no {kind} {shorten(name)!r}; {nearest(name, functions)}; for example {_EXAMPLES[kind]}")
    function = functions[name]
    try:
        bound = signature(function).bind(*arguments, **by_name)
    except TypeError as error:
        listed = ", ".join([*map(shown, arguments), *(f"{key}={shown(x)}" for key, x in by_name.items())])
        form = ", ".join(map(_written, signature(function).parameters.values()))
        raise SweepError(f"{shorten(f'{name}({listed})')}: {error}; write {name}({form})") from None
    return function(*bound.args, **bound.kwargs)


def _written(parameter: Parameter) -> str:
    """Return a parameter as it is written in a call: a name, `name=default`, or `name=…` if it has no default."""
    if parameter.default is not Parameter.empty:
        return f"{parameter.name}={parameter.default!r}"
    if parameter.kind is Parameter.KEYWORD_ONLY:
        return f"{parameter.name}=…"
    return str(parameter.replace(annotation=Parameter.empty))
