"""The syntax tree of a plain function, checked against its bytecode; errors of untranslatable constructs."""

from __future__ import annotations

import ast
import builtins
import linecache
from collections import ChainMap, Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from types import CodeType, FunctionType
from typing import Any

from robot_dyn.codegen.store.definition import code_parts
from robot_dyn.foundations.errors import TraceError


class SubsetError(TraceError):
    """A construct that is not translated to machine code."""


def refused(function: Callable[..., object], line: int, construct: str, remedy: str) -> SubsetError:
    """Return the error of a construct, with its line and a remedy."""
    code = function.__code__
    return SubsetError(
        f"{code.co_filename}, line {line}, in {code.co_qualname}: {construct} is not translated; {remedy}"
    )


def syntax(function: Callable[..., object]) -> ast.FunctionDef:
    """Return the syntax tree of a function.

    Raises:
        SubsetError: If the source is missing, or has changed since the function was defined.
    """
    if not isinstance(function, FunctionType):
        raise SubsetError(f"{function!r} is not translated; call plain functions")
    code = function.__code__
    linecache.checkcache(code.co_filename)
    text = "".join(linecache.getlines(code.co_filename))
    place = code.co_qualname, code.co_firstlineno
    trees, codes = _module(text, code.co_filename)
    if place not in trees:
        remedy = "write it with def, in a file or a cell of a notebook"
        raise refused(function, code.co_firstlineno, "a function without its source", remedy)
    if code_parts(codes[place]) != code_parts(code):
        remedy = "import the module again"
        raise refused(function, code.co_firstlineno, "a function whose source has changed since it was read", remedy)
    return trees[place]


def names_of(function: FunctionType) -> Mapping[str, object]:
    """Return the values of names that a function does not assign: from its closure, its module, and Python."""
    closure = {}
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        with suppress(ValueError):  # unassigned so far
            closure[name] = cell.cell_contents
    maps: list[Any] = [closure, function.__globals__, vars(builtins)]
    return ChainMap(*maps)


@lru_cache(maxsize=64)
def _module(text: str, file: str) -> tuple[dict[tuple[str, int], ast.FunctionDef], dict[tuple[str, int], CodeType]]:
    """Return the syntax trees and the code of all functions of a module, by name and first line."""
    try:
        tree = ast.parse(text)
        code = compile(tree, file, "exec", dont_inherit=True)
    except (SyntaxError, ValueError):
        return {}, {}
    codes = {(inner.co_qualname, inner.co_firstlineno): inner for inner in _codes(code)}
    places = {(name.rpartition(".")[2], line): (name, line) for name, line in codes}
    trees = {}
    for node in _functions(tree):
        place = places.get((node.name, min(part.lineno for part in (node, *node.decorator_list))))
        if place is not None:
            trees[place] = node
    return trees, codes


def _functions(node: ast.AST) -> Iterator[ast.FunctionDef]:
    """Return the functions in a module, in its classes, branches and other functions."""
    for name in ("body", "orelse", "finalbody", "handlers"):
        for child in getattr(node, name, []):
            if isinstance(child, ast.FunctionDef):
                yield child
            if isinstance(child, ast.stmt | ast.excepthandler):
                yield from _functions(child)


@lru_cache(maxsize=1024)
def stores(tree: ast.FunctionDef) -> Counter[str]:
    """Return the number of assignments to each name of a function."""
    return Counter(x.id for x in ast.walk(tree) if isinstance(x, ast.Name) and isinstance(x.ctx, ast.Store))


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)
