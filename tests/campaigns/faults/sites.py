"""Where a fault can be planted: signs, indices, factors and units in the statements of a file."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

KINDS = ("sign", "index", "factor", "unit")
# What computes. Names are those of the old tree; `HOMES` says where tests of it are.
FOLDERS = (
    "description", "shapes", "model", "lagrange", "queries", "effects", "control", "integrate", "simulation", "codegen",
    "studies/certificate", "studies/costs", "studies/work_precision_diagram", "accuracy",
)  # fmt: skip
SAYS = {"text", "html", "diagram", "figure", "explanation", "overview", "table", "why", "findings", "info", "summary"}
SPOKEN = re.compile(r"__str__|__repr__|_repr_|explain|_text$|_said$|message")
UNITS = re.compile(r"_(s|m|n|nm|kg|rad|hz|j|w|m_s|rad_s|ns|us)$")
SIGNS = {ast.Add: ast.Sub, ast.Sub: ast.Add}
FACTORS = {ast.Mult: ast.Div, ast.Div: ast.Mult}


@dataclass(frozen=True)
class Site:
    """One fault that can be planted.

    Attributes:
        kind: One of `KINDS`.
        file: File, relative to the package.
        scope: Class and function that the statement is in, with dots.
        statement: The statement without its blocks, as `ast.unparse` writes it; the same in another layout.
        part: Which part of the statement changes, counted among the faults of this kind in it.
        before: The part that changes, as `ast.unparse` writes it.
        after: What it becomes.
        span: Bytes of the file that it replaces, from and to.
    """

    kind: str
    file: str
    scope: str
    statement: str
    part: int
    before: str
    after: str
    span: tuple[int, int]

    @property
    def id(self) -> str:
        """Name of the fault."""
        return f"{self.kind} in {self.file}, {self.scope or 'module'}: {self.before} -> {self.after} (#{self.part})"

    def planted(self, source: bytes) -> bytes:
        """The file with the fault."""
        return source[: self.span[0]] + self.after.encode() + source[self.span[1] :]


def files(tree: Path) -> list[str]:
    """Files of a tree that compute, relative to the package."""
    package = tree / "robot_dyn"
    found = {path for folder in FOLDERS for path in (package / folder).rglob("*.py") if path.stem not in SAYS}
    return sorted(path.relative_to(package).as_posix() for path in found)


def sites(tree: Path, file: str) -> list[Site]:
    """All faults of one file."""
    source = (tree / "robot_dyn" / file).read_bytes()
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found = []
    for scope, statement in _statements(ast.parse(source).body, ""):
        text = ast.unparse(_header(statement))
        counts = dict.fromkeys(KINDS, 0)
        for kind, node, after in _faults(statement):
            span = (
                starts[node.lineno - 1] + node.col_offset,
                starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0),
            )
            site = Site(kind, file, scope, text, counts[kind], ast.unparse(node), after, span)
            counts[kind] += 1
            found.append(site)
    return found


def ported(site: Site, tree: Path, known: dict[str, list[Site]]) -> Site | None:
    """The same fault in another tree: in the same statement; else the same expression in a function of the same name.

    Among several, that of the same scope and file name. None if the statement is no longer there.
    """
    if not known:
        known |= {file: sites(tree, file) for file in files(tree)}
    every = [each for those in known.values() for each in those if (each.kind, each.before) == (site.kind, site.before)]
    alike = [each for each in every if (each.statement, each.part) == (site.statement, site.part)]
    name = site.scope.rpartition(".")[2]
    moved = [each for each in every if name and each.scope.rpartition(".")[2] == name and len(site.before) > 4]

    def nearness(each: Site) -> tuple[bool, bool, bool, int]:
        same_name = Path(each.file).name == Path(site.file).name
        return each.scope == site.scope and same_name, same_name, each.scope == site.scope, -abs(each.part - site.part)

    for those in (alike, moved):
        if those:
            return replace(max(those, key=nearness), after=site.after)
    return None


def _statements(body: list[ast.stmt], scope: str) -> Iterator[tuple[str, ast.stmt]]:
    """Statements that compute, with their scope; nothing in errors, in what is said, or for types only."""
    for each in body:
        if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            if not SPOKEN.search(each.name):
                yield from _statements(each.body, f"{scope}.{each.name}".lstrip("."))
            continue
        docstring = isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant)
        if docstring or isinstance(each, ast.Raise | ast.Import | ast.ImportFrom | ast.Assert):
            continue
        if isinstance(each, ast.If) and ast.unparse(each.test) == "TYPE_CHECKING":
            continue
        yield scope, each
        for inner in ("body", "orelse", "finalbody"):
            yield from _statements(getattr(each, inner, []), scope)
        for handler in (*getattr(each, "handlers", []), *getattr(each, "cases", [])):
            yield from _statements(handler.body, scope)


def _header(statement: ast.stmt) -> ast.AST:
    """A statement without its blocks."""
    fields = dict(ast.iter_fields(statement))
    for inner in ("body", "orelse", "finalbody", "handlers", "cases"):
        if isinstance(fields.get(inner), list):
            fields[inner] = [ast.Pass()] if inner == "body" else []
    if isinstance(statement, ast.Try | ast.TryStar):
        fields["finalbody"] = [ast.Pass()]
    if isinstance(statement, ast.Match):
        return statement.subject
    return ast.fix_missing_locations(type(statement)(**fields, lineno=statement.lineno, col_offset=0))


def _expressions(statement: ast.stmt) -> Iterator[tuple[ast.AST, ast.AST]]:
    """Expressions of a statement with what holds them; none in its blocks, annotations and texts."""
    waiting: list[tuple[ast.AST, ast.AST]] = [(statement, statement)]
    while waiting:
        node, holder = waiting.pop(0)
        if node is not statement:
            if isinstance(node, ast.stmt | ast.JoinedStr | ast.ExceptHandler | ast.match_case):
                continue
            yield node, holder
        skipped = {"annotation", "returns", "type_comment", "decorator_list"}
        for name, value in ast.iter_fields(node):
            if name not in skipped:
                waiting += [
                    (each, node)
                    for each in (value if isinstance(value, list) else [value])
                    if isinstance(each, ast.AST)
                ]


def _faults(statement: ast.stmt) -> Iterator[tuple[str, ast.expr, str]]:
    """Kind, expression that is replaced, and what replaces it."""
    for node, holder in _expressions(statement):
        match node:
            case ast.BinOp(left=left, op=op, right=right) if type(op) in SIGNS and not (
                _is_text(left) or _is_text(right)
            ):
                if not isinstance(holder, ast.Slice) and not _whole(right):
                    yield "sign", node, ast.unparse(ast.BinOp(left, SIGNS[type(op)](), right))
            case ast.BinOp(left=left, op=op, right=right) if type(op) in FACTORS and not (
                _is_text(left) or _is_text(right)
            ):
                yield "factor", node, ast.unparse(ast.BinOp(left, FACTORS[type(op)](), right))
                for each in (left, right):
                    if (
                        isinstance(each, ast.Constant)
                        and isinstance(each.value, int | float)
                        and each.value not in (0, 1)
                    ):
                        yield "factor", each, repr(each.value * 2)
            case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int(power))):
                yield "factor", node, ast.unparse(ast.BinOp(left, ast.Pow(), ast.Constant(power + 1)))
            case ast.UnaryOp(op=ast.USub(), operand=operand) if not isinstance(operand, ast.Constant):
                yield "sign", node, f"({ast.unparse(operand)})"
            case ast.Subscript(slice=place):
                yield from (("index", each, moved) for each, moved in _indices(place))
            case ast.Call(func=ast.Attribute(attr="radians" | "degrees"), args=[argument]):
                yield "unit", node, f"({ast.unparse(argument)})"
            case ast.Constant(value=float(number)) if number in (1e-3, 1e3, 1e-6, 1e6, 1e9, 1e-9, 180.0, 60.0):
                yield "unit", node, repr(number * 10)
            case ast.keyword(arg=str(name), value=value) if UNITS.search(name) and not isinstance(value, ast.Constant):
                yield "unit", value, f"(({ast.unparse(value)}) * {_scale(name)})"
    if isinstance(statement, ast.Assign | ast.AugAssign | ast.AnnAssign) and statement.value is not None:
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        names = [ast.unparse(each).rpartition(".")[2] for each in targets]
        if len(names) == 1 and UNITS.search(names[0]) and not isinstance(statement.value, ast.Tuple | ast.Constant):
            yield "unit", statement.value, f"(({ast.unparse(statement.value)}) * {_scale(names[0])})"


def _indices(place: ast.expr) -> Iterator[tuple[ast.expr, str]]:
    """Whole numbers of a subscript, each with the next one."""
    match place:
        case ast.Constant(value=int(i)) if not isinstance(i, bool):
            yield place, str(i + 1)
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int(i))):
            yield place, str(-i - 1)
        case ast.BinOp(op=ast.Add() | ast.Sub(), left=left, right=ast.Constant(value=int(i))):
            yield place, ast.unparse(ast.BinOp(left, place.op, ast.Constant(i + 1)))
        case ast.Tuple(elts=many):
            for each in many:
                yield from _indices(each)
        case ast.Slice(lower=lower, upper=upper):
            for each in (lower, upper):
                if each is not None:
                    yield from _indices(each)
        case ast.Name(id="i" | "j" | "k" | "row" | "column" | "index"):
            yield place, f"{place.id} - 1"


def _scale(name: str) -> str:
    return "57.29577951308232" if "rad" in name else "1000.0"


def _whole(node: ast.expr) -> bool:
    """Whether it is a number that counts, as in `n - 1`, where another sign only raises."""
    return isinstance(node, ast.Constant) and isinstance(node.value, int)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr | ast.List | ast.Tuple) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str)
    )


def is_python(source: bytes) -> bool:
    """Whether a file with a fault is still one of Python."""
    try:
        compile(source, "planted", "exec")
    except (SyntaxError, ValueError):
        return False
    return True
