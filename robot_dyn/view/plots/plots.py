"""Figures of a run: joints, torques against limits, energy ledger, tracking error, phase portrait, error growth.

Each is a `Panel` of curves, which `figure.draw` draws.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, final

import numpy as np

from robot_dyn import files
from robot_dyn.description import description
from robot_dyn.errors import DescriptionError, QueryError, RobotDynError
from robot_dyn.queries.units import unit
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.validate import choice, instance, number, shaped
from robot_dyn.view.plots.figure import DESIRED, NEAR, THEMES, Cell, Curve, Panel, draw
from robot_dyn.view.rests import rests

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_JOINTS = 64  # that one figure shows
PICTURES = (
    files.Kind("a plot", ".png", b"\x89PNG"),
    files.Kind("a plot", ".svg", b"<?xml"),
    files.Kind("a plot", ".pdf", b"%PDF"),
)


class PlotError(RobotDynError):
    """A run with nothing to draw, or a picture that cannot be written."""


@final
@dataclass(frozen=True, eq=False)
class View:
    """The shown part of a run: joints by column, each with its type, and its effort limit in [N m] or [N]."""

    run: Trajectory
    joints: tuple[int, ...]
    types: tuple[str | None, ...]
    limits: np.ndarray

    @property
    def names(self) -> list[str]:
        """Names of the joints shown."""
        return [self.run.joint_names[i] for i in self.joints]

    def unit(self, quantity: str, i: int) -> str:
        """Unit of a quantity of a joint; both units where its type is not known."""
        return unit(quantity, self.types[i])


def joints(view: View) -> Panel:
    """Position and velocity of each joint, with the desired position where there is a reference, and its rests."""
    run, cells, held = view.run, [], rests(view.run)
    for i, name in zip(view.joints, view.names, strict=True):
        q = [Curve("actual", run.t, run.q[:, i])]
        if run.desired is not None:
            q.append(Curve("desired", run.t, run.desired[:, i], DESIRED))
        marks = tuple(each.t for each in run.events if each.joint in ("", name))
        cells.append(Cell(name, "", f"q [{view.unit('q', i)}]", tuple(q), marks=marks, rests=held[i]))
        v = (Curve("actual", run.t, run.v[:, i]),)
        cells.append(Cell("", "t [s]", f"v [{view.unit('v', i)}]", v, marks=marks, rests=held[i]))
    pairs = zip(_grid(cells[::2]), _grid(cells[1::2]), strict=True)
    shown = [each for i in view.joints for each in held[i]]
    legend = [("events are dotted", run.events), ("where a joint is held is shaded", shown)]
    legend.append(("at a stop in colour", [each for each in shown if each.at_stop]))
    marked = "".join(f"; {text}" for text, some in legend if some)
    return Panel(f"Joint positions and velocities{marked}", tuple(row for pair in pairs for row in pair))


def torques(view: View) -> Panel:
    """Actuation of each joint against ± its effort limit, with the part of it that was used, between samples too.

    Raises:
        PlotError: If it was not recorded.
    """
    if np.isnan(view.run.u).all():
        raise PlotError("the torques of the run were not recorded; add u to record of rollouts")
    cells = []
    for i, name in zip(view.joints, view.names, strict=True):
        u, limit = view.run.u[:, i], float(view.limits[i])
        every = u if view.run.extremes is None else np.append(u, view.run.extremes[2, :, i])
        peak = float(np.max(np.abs(every), where=np.isfinite(every), initial=0.0))
        used = f"{peak / limit:.0%}" if peak < 10 * limit else "over 1000%"
        note = f", {used} used" if np.isfinite(limit) else ""
        curves = (Curve("u", view.run.t, u),)
        cells.append(Cell(name, "t [s]", f"u [{view.unit('u', i)}]", curves, limit=limit, note=note))
    shown = (
        f"; effort limits are dashed where over {NEAR:.0%} are used"
        if np.isfinite(view.limits[list(view.joints)]).any()
        else ""
    )
    return Panel("Actuation" + shown, _grid(cells))


def energy(view: View) -> Panel:
    """K, V and E from the start, the work of each source, and what the ledger leaves over, on an axis of its own.

    Raises:
        PlotError: If they were not recorded.
    """
    t, ledger = view.run.t, view.run.ledger
    if not ledger.known:
        raise PlotError("energy and work of the run were not recorded; add energy and work to record of rollouts")
    E, V = ledger.energy, ledger.potential
    own = (("K", ledger.kinetic), ("V − V(0)", V - V[0]), ("E − E(0)", E - E[0]))
    stores = tuple(Curve(label, t, y, (i, i)) for i, (label, y) in enumerate(own))
    works = tuple(Curve(f"W {name}", t, y, (i + 3, i)) for i, (name, y) in enumerate(ledger.work.items()))
    left = Curve("|residual|", t, np.abs(ledger.residual))
    sole = f" by {next(iter(ledger.work))}" if len(works) == 1 else ""
    cells = [Cell("Energy since the start", "", "energy [J]", stores)]
    cells += [Cell(f"Work since the start{sole}", "", "work [J]", works)] if works else []
    cells.append(Cell("Residual |E − E(0) − Σ W|", "t [s]", "residual [J]", (left,), log=True))
    known = np.isfinite(left.y).any() and np.isfinite(ledger.exchanged)
    part = f": the residual is {ledger.closure:.1e} of what was exchanged" if known else ""
    return Panel(f"Energy ledger{part}", tuple((cell,) for cell in cells), 1.5)


def tracking(view: View) -> Panel:
    """Deviation of each joint, or of the frame along each axis, from the reference.

    Raises:
        PlotError: If the run followed no reference.
    """
    run = view.run
    if run.deviation is None:
        raise PlotError(
            "the run has no tracking error, since it followed no reference; simulate with a controller that has one"
        )
    names, units, columns = view.names, [view.unit("q", i) for i in view.joints], list(view.joints)
    if run.desired is None:
        names, units, columns = [f"frame, {axis}" for axis in "xyz"], ["m"] * 3, [0, 1, 2]
    off = run.deviation[:, columns]
    each = zip(names, units, off.T, strict=True)
    cells = [Cell(name, "t [s]", f"error [{unit}]", (Curve("error", run.t, y),)) for name, unit, y in each]
    rms = {unit: _rms(off[:, [each == unit for each in units]]) for unit in dict.fromkeys(units)}
    return Panel("Tracking error, rms " + ", ".join(f"{x:.2e} {unit}" for unit, x in rms.items()), _grid(cells))


def phase(view: View) -> Panel:
    """Phase portrait of each joint: v over q."""
    run, cells = view.run, []
    for i, name in zip(view.joints, view.names, strict=True):
        path = Curve("path", run.q[:, i], run.v[:, i])
        start = Curve("start", run.q[:1, i], run.v[:1, i], (1, 0))
        cells.append(Cell(name, f"q [{view.unit('q', i)}]", f"v [{view.unit('v', i)}]", (path, start)))
    return Panel("Phase portrait", _grid(cells), 2.0)


def error_growth(view: View) -> Panel:
    """Estimated error of the positions, the largest over the joints, and the time until which it is resolved.

    Raises:
        PlotError: If the run has no estimate.
    """
    error = view.run.error
    if error is None or len(error.t) < 2:
        why = "estimate_error was False" if error is None else error.note or "it ended too soon"
        raise PlotError(f"the run has no estimate of its error ({why}); simulate with estimate_error=True")
    units = {unit("q", each) for each in view.types}
    of_q = units.pop() if len(units) == 1 else unit("q", None)
    until = error.resolved_until if error.resolved_until < error.t[-1] else np.inf
    curve = Curve("estimated error", error.t, error.error)
    cell = Cell("", "t [s]", f"|q − exact| [{of_q}]", (curve,), log=True, until=until)
    return Panel(f"Error of the positions: {error}", ((cell,),), 1.5)


PLOTS: Mapping[str, Callable[[View], Panel]] = MappingProxyType(
    {f.__name__: f for f in (joints, torques, energy, tracking, phase, error_growth)}
)


def plot(
    run: Trajectory,
    *names: str,
    only: Collection[str] | None = None,
    limits: np.ndarray | None = None,
    theme: Literal["light", "dark"] = "light",
) -> Figure:
    """Return a figure of a run, the plots one under the other.

    Args:
        run: With m samples of n joints.
        *names: Of `PLOTS`; all that apply to the run if none is given.
        only: Names of the joints to show; all if not given.
        limits: Effort limits, shape (n,), in [N m] or [N], inf for none; those of the run's URDF if not given.
        theme: For "light" or "dark" paper.

    Raises:
        QueryError: If a plot, a joint or a theme is unknown, or the limits have another shape.
        PlotError: If the run has no samples, too many joints, or lacks what a requested plot shows.
    """
    instance("run", run, Trajectory, "give the trajectory of rd.simulate, or a run of rollouts, as runs[0]")
    instance("only", only, Collection | None, "give names of joints")
    for kind, known, asked in (("plot", PLOTS, names), ("theme", THEMES, (theme,)), ("joint", run.joint_names, only)):
        for name in () if asked is None else asked:
            choice(kind, name, known)
    if not len(run.t):
        raise PlotError("the run has no samples, so there is nothing to draw; simulate again")
    view = _view(run, only, limits)
    panels = []
    with np.errstate(all="ignore"):  # the last samples of a run that diverged may overflow
        for name in names or PLOTS:
            try:
                panels.append(PLOTS[name](view))
            except PlotError:
                if names:
                    raise
        return draw(panels, run, THEMES[theme])


def save_plot(run: Trajectory, path: str | Path, *names: str, dpi: float = 150, **options: Any) -> Path:
    """Write a figure of a run as PNG, SVG or PDF by the suffix of `path` (.png is added if it has none).

    Another picture of that format under that name is replaced; a file of another kind is not.

    Args:
        run: As `plot`.
        path: Where to.
        *names: As `plot`.
        dpi: Dots per inch of a PNG.
        **options: As `plot`.

    Raises:
        PlotError: If it cannot be written; else as `plot`.
    """
    dpi = number("dpi", dpi, above=0)
    path = files.target(path, PICTURES, PlotError)
    picture = io.BytesIO()
    figure = plot(run, *names, **options)
    try:
        figure.savefig(picture, format=path.suffix[1:].lower(), dpi=dpi)
    except (ValueError, MemoryError) as error:
        raise PlotError(f"{path}: cannot be drawn at {dpi:g} dpi ({error}); show less, or choose 150") from None
    return files.save(path, lambda stream: stream.write(picture.getvalue()), PlotError)


def _view(run: Trajectory, only: Collection[str] | None, limits: np.ndarray | None) -> View:
    """Types of joints and effort limits by the URDF of the run; without one both units are named."""
    shown = tuple(i for i, name in enumerate(run.joint_names) if only is None or name in only)
    if not 0 < len(shown) <= MOST_JOINTS:
        count = f"{len(shown)} joints, and one figure shows 1 to {MOST_JOINTS}"
        raise PlotError(f"{count}; name those to show, such as only={list(run.joint_names[:2])}")
    try:
        element = description.check(run.about.get("urdf", "").encode(), "the run's URDF").element
        of = {joint.get("name"): joint for joint in element.iterfind("joint")}
    except DescriptionError:
        of = {}
    known = [of.get(name) for name in run.joint_names]
    types = tuple(None if j is None else j.get("type") for j in known)
    if limits is None:
        limits = np.array([np.inf if j is None else float(j.find("limit").get("effort")) for j in known])
    efforts = shaped("limits", limits, run.joint_names).astype(float)  # nan: none is known
    if efforts.ndim != 1:
        raise QueryError(f"limits must have shape ({len(known)},), got {efforts.shape}")
    return View(run, shown, types, np.where((efforts > 0) & (efforts < 1e300), efforts, np.inf))  # 0: none is stated


def _rms(z: np.ndarray) -> float:
    known = z[np.isfinite(z)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")


def _grid(cells: list[Cell]) -> tuple[tuple[Cell, ...], ...]:
    n = len(cells)
    wide = n if n <= 4 else 3 if n in (5, 6, 9) else 4 if n <= 16 else 5
    return tuple(tuple(cells[i : i + wide]) for i in range(0, n, wide))
