"""Signatures of functions that take options by keyword, whose names and defaults are defined elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from inspect import Parameter, signature
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


class _Unchanged:
    def __repr__(self) -> str:
        return "unchanged"


UNCHANGED = _Unchanged()
"""In a signature: what is not given stays as it is."""


def takes(options: Iterable[Parameter]) -> Callable[[Function], Function]:
    """A decorator: `help`, `inspect.signature` and completion show each option in place of `**options`."""

    def decorate(function: Function) -> Function:
        known = signature(function)
        given = [each for each in known.parameters.values() if each.kind is not Parameter.VAR_KEYWORD]
        by_keyword = [each.replace(kind=Parameter.KEYWORD_ONLY) for each in options]
        function.__signature__ = known.replace(parameters=[*given, *by_keyword])  # pyright: ignore[reportFunctionMemberAccess]
        return function

    return decorate


def unchanged(names: Iterable[str]) -> list[Parameter]:
    """Options that leave unchanged what is not given."""
    return [Parameter(name, Parameter.KEYWORD_ONLY, default=UNCHANGED) for name in names]
