"""Weight of a call: the number of files of the package that the module of a public function imports, directly or not.

Imports inside functions count; imports for type checkers do not, and are added in a second column. A name imported from
a folder is resolved by the `__init__.pyi` of the folder.

    python scripts/weight.py                                the table for this tree
    python scripts/weight.py --root DIR NAME=MODULE ...     another tree, whose layout may differ
    python scripts/weight.py --cuts robot_dyn.simulation.simulate    imports without which most files fall away
"""

from __future__ import annotations

import ast
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Iterator, Mapping
from pathlib import Path

CALLS = {
    'rd.load("ur5").M(q)': "robot_dyn.model.loading",
    "rd.compare": "robot_dyn.cross_check.compare",
    "rd.simulate": "robot_dyn.simulation.simulate",
    "rd.rollouts": "robot_dyn.simulation.rollouts.rollouts",
    "sweeps.run": "robot_dyn.tools.sweeps.run_sweep",
}
MOST_CUTS = 20

Graph = Mapping[str, set[str]]  # modules that each module imports


def imports(node: ast.AST, checkers: bool) -> Iterator[ast.Import | ast.ImportFrom]:
    """Yield the imports below a node, with or without those for type checkers."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child
        elif isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test) and not checkers:
            for other in child.orelse:
                yield from imports(other, checkers)
        else:
            yield from imports(child, checkers)


def graph_of(root: Path, checkers: bool = False) -> Graph:
    """Return the modules that each module of robot_dyn in a folder imports."""
    paths = {_module(path.relative_to(root)): path for path in (root / "robot_dyn").rglob("*.py")}
    homes: dict[str, str] = {}  # module of each name that a folder lists
    for path in (root / "robot_dyn").rglob("__init__.pyi"):
        folder = _module(path.relative_to(root))
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom):
                homes |= {f"{folder}.{name.name}": str(node.module) for name in node.names}

    def imported(path: Path) -> Iterator[str]:
        for node in imports(ast.parse(path.read_text(encoding="utf-8")), checkers):
            if isinstance(node, ast.Import):
                yield from (name.name for name in node.names)
                continue
            for name in node.names:
                full = f"{node.module}.{name.name}"
                yield full if full in paths else homes.get(full, str(node.module))

    return {module: set(imported(path)) & set(paths) for module, path in paths.items()}


def closure(graph: Graph, start: str, without: tuple[str, str] | None = None) -> set[str]:
    """Return all modules that a module imports, itself included, without one import."""
    reached, left = {start}, [start]
    while left:
        module = left.pop()
        new = {other for other in graph[module] if (module, other) != without} - reached
        reached |= new
        left += new
    return reached


def cuts(graph: Graph, start: str) -> list[tuple[int, str, str]]:
    """Return the imports without which modules fall away from a closure, and how many; the most first."""
    reached = closure(graph, start)
    pairs = [(module, other) for module in reached for other in graph[module]]
    lost = ((len(reached) - len(closure(graph, start, pair)), *pair) for pair in pairs)
    return sorted((cut for cut in lost if cut[0] > 1), reverse=True)[:MOST_CUTS]


def _module(path: Path) -> str:
    return ".".join(path.with_suffix("").parts).removesuffix(".__init__")


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=Path(__file__).parents[1])
    parser.add_argument("--cuts", metavar="MODULE")
    parser.add_argument("--quick", action="store_true", help="without imports for type checkers")
    parser.add_argument("calls", nargs="*", metavar="NAME=MODULE")
    given = parser.parse_args()
    graph = graph_of(given.root)
    if given.cuts:
        for count, module, other in cuts(graph, given.cuts):
            print(f"{count:4}  {module} imports {other}")
    else:
        typed, calls = (
            graph if given.quick else graph_of(given.root, checkers=True),
            dict(call.rsplit("=", 1) for call in given.calls) or CALLS,
        )
        print(f"{'call':24}{'files':>8}{'with imports for type checkers':>34}   of {len(graph)}")
        for name, module in calls.items():
            print(f"{name:24}{len(closure(graph, module)):8}{len(closure(typed, module)):34}")
