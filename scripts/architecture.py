"""The rooms of the package and which imports which, read from the sources and drawn: docs/pictures/architecture.png.

A row of the figure is a layer of the import-linter contract in pyproject.toml, from the top downward. The picture holds
the imports as text, so that it can be compared with the sources.
"""

from __future__ import annotations

import ast
import sys
import tomllib
from collections.abc import Iterator
from io import BytesIO
from itertools import product
from pathlib import Path

from benchmarks.measure import PICTURES, command_line
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from PIL import Image

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "robot_dyn"
PICTURE = PICTURES / "architecture.png"
Imports = set[tuple[str, str]]  # (importing room, imported room)
Place = tuple[float, float]
DARK, UPWARD, FILL = "#1f3b57", "#c0392b", "#eef3f8"
WIDTH, HEIGHT = 1.5, 0.5  # of a box; rows are 1 apart
BASE = "foundations"
ACROSS = {  # middles of the boxes, such that no arrow passes behind another box
    "tools": 0.0, "cli": -1.2, "scene": -3.0, "accuracy": 3.3, "report": 1.4, "view": 0.6, "simulation": 0.0,
    "codegen": -1.0, "effects": -3.2, "control": -1.2, "integrate": 1.3, "cross_check": 3.3, "model": -0.7,
    "lagrange": 1.6, "shapes": 3.2, "queries": -0.6, "description": 2.4,
}  # fmt: skip


def layers() -> list[list[str]]:
    """Members of each layer of the first contract, from the top downward."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    columns = project["tool"]["importlinter"]["contracts"][0]["layers"]
    return [[name.strip().removeprefix("robot_dyn.") for name in layer.split("|")] for layer in columns]


def is_room(name: str) -> bool:
    """Whether a member of a layer is a folder, not a single file."""
    return (PACKAGE / name / "__init__.py").exists()


def executed(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes below this one, but for what only type checkers read."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
            continue
        yield child
        yield from executed(child)


def public_homes() -> dict[str, str]:
    """Where each public name is defined, `robot_dyn.x.y.name`, as `robot_dyn/__init__.pyi` lists them."""
    tree = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    nodes = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module)
    return {each.name: f"{node.module}.{each.name}" for node in nodes for each in node.names}


def imported(path: Path, homes: dict[str, str]) -> Iterator[str]:
    """Modules that a file imports, in a function or at the top; of a name of `rd` that in which it is defined."""
    for node in executed(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            names = (f"{node.module}.{each.name}" for each in node.names)
            yield from (homes.get(name.removeprefix("robot_dyn."), name) for name in names)
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) == "rd":
            yield homes.get(node.attr, "")


def imports() -> Imports:
    """Pairs of rooms of which a file of the first imports from the second."""
    homes, rooms = public_homes(), [name for layer in layers() for name in layer if is_room(name)]
    found = {
        (room, name.split(".")[1])
        for room in rooms
        for path in (PACKAGE / room).rglob("*.py")
        for name in imported(path, homes)
        if name.startswith("robot_dyn.")
    }
    return {(room, other) for room, other in found if other in rooms and other != room}


def implied(pairs: Imports) -> Imports:
    """Those pairs between which another path leads."""
    rooms = {room for pair in pairs for room in pair}
    reached = set(pairs)
    for middle, start, end in product(rooms, repeat=3):  # Warshall's order: the middle outermost
        if (start, middle) in reached and (middle, end) in reached:
            reached.add((start, end))
    return {(start, end) for start, end in pairs if any((start, m) in pairs and (m, end) in reached for m in rooms)}


def text(pairs: Imports) -> str:
    """The rooms from the top downward, a line each, with what they import."""
    order = [name for layer in layers() for name in layer]
    rooms = [name for name in order if is_room(name)]
    below = {room: [other for other in rooms if (room, other) in pairs] for room in rooms}
    return "\n".join(f"{room}: {', '.join(below[room])}" for room in rooms)


def arrow(start: Place, end: Place, upward: bool) -> FancyArrowPatch:
    """An arrow from the lower edge of one box to the upper edge of another; an upward one bends to the left."""
    (x, y), (to_x, to_y) = start, end
    if upward:
        ends = (x - WIDTH / 2, y), (to_x - WIDTH / 2, to_y)
    else:
        lean = 0.3 * max(-2.0, min(2.0, to_x - x))
        ends = (x + lean, y - HEIGHT / 2), (to_x - lean, to_y + HEIGHT / 2)
    return FancyArrowPatch(
        *ends, arrowstyle="-|>", mutation_scale=13, linewidth=1.5, color=UPWARD if upward else DARK, zorder=1,
        linestyle="--" if upward else "-", connectionstyle=f"arc3,rad={-0.5 if upward else 0.0}", shrinkA=0, shrinkB=0,
    )  # fmt: skip


def box(axes: Axes, place: Place, width: float, label: str, size: float) -> None:
    x, y = place
    axes.add_patch(FancyBboxPatch(
        (x - width / 2, y - HEIGHT / 2), width, HEIGHT, boxstyle="round,pad=0,rounding_size=0.08",
        facecolor=FILL, edgecolor=DARK, linewidth=1.2, zorder=2,
    ))  # fmt: skip
    axes.text(x, y, label, ha="center", va="center", fontsize=size, color=DARK, zorder=3)


def drawn(pairs: Imports) -> Figure:
    """Draw rooms as boxes and imports as arrows, without those that others imply; upward ones are dashed."""
    rows = [layer for layer in layers() if layer != [BASE]]
    pairs = {(start, end) for start, end in pairs if end != BASE}
    at = {room: (ACROSS[room], -float(down)) for down, rooms in enumerate(rows) for room in rooms}
    upward = {(start, end) for start, end in pairs if at[end][1] >= at[start][1]}
    figure = Figure(figsize=(9.0, 10.0), facecolor="white")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    for start, end in sorted(pairs - implied(pairs - upward)):
        axes.add_patch(arrow(at[start], at[end], (start, end) in upward))
    for room, place in at.items():
        box(axes, place, WIDTH, room, 14)
    box(axes, (0.0, -float(len(rows))), 7.8, f"{BASE}: every room may import them", 14)
    axes.set_xlim(-4.2, 4.2)
    axes.set_ylim(-len(rows) - 0.4, 0.4)
    return figure


if __name__ == "__main__":
    quick = command_line(__doc__, "write no file, and fail if the picture shows other imports").parse_args().quick
    pairs = imports()
    print(text(pairs))
    figure = drawn(pairs)
    FigureCanvasAgg(figure).print_png(BytesIO() if quick else PICTURE, metadata={"Description": text(pairs)})
    with Image.open(PICTURE) as picture:
        if picture.info["Description"] != text(pairs):
            sys.exit(f"{PICTURE.relative_to(ROOT)} shows other imports: run python scripts/architecture.py")
