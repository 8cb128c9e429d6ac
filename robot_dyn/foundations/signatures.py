"""Signatures of functions that take keyword options whose names and defaults are defined elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from inspect import Parameter, signature
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


class _Unchanged:
    def __repr__(self) -> str:
        return "unchanged"


UNCHANGED = _Unchanged()
"""Default in a signature of an option that leaves the value unchanged."""


def takes(options: Iterable[Parameter]) -> Callable[[Function], Function]:
    """Return a decorator: `help`, `inspect.signature` and completion then show the options instead of `**options`."""

    def decorate(function: Function) -> Function:
        old = signature(function)
        parameters = [x for x in old.parameters.values() if x.kind is not Parameter.VAR_KEYWORD]
        parameters += [option.replace(kind=Parameter.KEYWORD_ONLY) for option in options]
        function.__signature__ = old.replace(parameters=parameters)  # pyright: ignore[reportFunctionMemberAccess]
        return function

    return decorate


def unchanged(names: Iterable[str]) -> list[Parameter]:
    """Return options with the default UNCHANGED."""
    return [Parameter(name, Parameter.KEYWORD_ONLY, default=UNCHANGED) for name in names]
