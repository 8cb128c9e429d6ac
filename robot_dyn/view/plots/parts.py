"""The parts of figures of a run: joints, torques against limits, energy ledger, tracking error, phase portrait, error.

The overview has a row for each joint, and a column for each of q, v, u and the tracking error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import final

import numpy as np

from robot_dyn.queries.units import unit
from robot_dyn.simulation.results.error_estimate import ErrorEstimate
from robot_dyn.simulation.results.run_data import TrajectoryData
from robot_dyn.view.plots.figure import DESIRED, NEAR, TIME, Cell, Curve
from robot_dyn.view.plots.pictures import PlotError
from robot_dyn.view.plots.sheet import Panel, in_rows
from robot_dyn.view.rests import Rest, rests

_CELL_MM, _WIDE_MM = 36.0, 60.0  # minimum width of a cell, and of one with a long title


@final
@dataclass(frozen=True, eq=False)
class View:
    """The shown part of a run, and the width of the figure.

    Attributes:
        run: The whole run.
        joints: Columns of the joints shown.
        types: Type of each joint of the run; None if unknown.
        efforts, speeds: Limits of u and v of each joint of the run, in SI units; inf for none.
        width: Width of the figure, in [mm].
    """

    run: TrajectoryData
    joints: tuple[int, ...]
    types: tuple[str | None, ...]
    efforts: np.ndarray
    speeds: np.ndarray
    width: float

    @property
    def names(self) -> list[str]:
        """Names of the joints shown."""
        return [self.run.joint_names[i] for i in self.joints]

    @property
    def columns(self) -> int:
        """Largest number of cells in a row."""
        return int(self.width / _CELL_MM)

    def unit(self, quantity: str, i: int) -> str:
        """Return the unit of a quantity of a joint; both units if its type is unknown."""
        return unit(quantity, self.types[i])


def overview(view: View) -> list[Panel]:
    """Return a row per joint with q, u, tracking error and v, as far as recorded; below, energy and errors."""
    run, held = view.run, rests(view.run)
    known = {"q": _position}
    known |= {"u": _torque} if np.nan_to_num(run.u).any() else {}
    known |= {"error": _off} if run.tracking_error is not None and run.desired is not None else {}
    known |= {"v": _velocity}
    shown = [name for name in ("q", "v", "u", "error") if name in list(known)[: view.columns]]
    rows = []
    for i in view.joints:
        first, *others = (known[name](view, i, held[i]) for name in shown)
        rows.append((first, *(replace(cell, title="") for cell in others)))
    limits = {name: values for name, values in (("v", view.speeds), ("u", view.efforts)) if name in shown}
    heading = f"Joints{_legend(view, held)}{_limits(view, **limits)}"
    heading += "; u is 0 throughout" if not run.u.any() else ""
    hidden = " and ".join(name for name in known if name not in shown)
    heading += f"; no room for {hidden}" if hidden else ""
    panels = [Panel(heading, tuple(rows), 24.0, every=len(rows))]
    if run.tracking_error is not None and run.desired is None:
        panels += tracking(view)
    lower = _ledger(view) if run.ledger.is_recorded else []
    lower += [_growth(view, run.error)] if run.error is not None and len(run.error.t) > 1 else []
    lower = [replace(cell, y=cell.y[cell.y.index("[") :]) for cell in lower]  # titles name the quantity
    across = max(1, min(2, int(view.width / _WIDE_MM)))
    return [*panels, Panel("", in_rows(lower, across), 32.0)] if lower else panels


def joints(view: View) -> list[Panel]:
    """Return position and velocity of each joint, with the desired position if there is a reference, and its rests."""
    held = rests(view.run)
    q = in_rows([_position(view, i, held[i]) for i in view.joints], view.columns)
    v = in_rows([replace(_velocity(view, i, held[i]), title="") for i in view.joints], view.columns)
    heading = f"Joint positions and velocities{_legend(view, held)}{_limits(view, v=view.speeds)}"
    return [Panel(heading, tuple(row for pair in zip(q, v, strict=True) for row in pair), 35.0, every=2)]


def torques(view: View) -> list[Panel]:
    """Return the actuation of each joint with ± its effort limit, and the largest fraction of it at any step.

    Raises:
        PlotError: If it was not recorded.
    """
    if np.isnan(view.run.u).all():
        raise PlotError('torques were not recorded; add "u" to record= of rollouts')
    cells = [_torque(view, i) for i in view.joints]
    return [Panel(f"Actuation{_limits(view, u=view.efforts)}", in_rows(cells, view.columns))]


def energy(view: View) -> list[Panel]:
    """Return K, V and E since the start, the work of each source, and the residual of the ledger on a separate axis.

    Raises:
        PlotError: If they were not recorded.
    """
    ledger = view.run.ledger
    if not ledger.is_recorded:
        raise PlotError('energy and work were not recorded; add "energy" and "work" to record= of rollouts')
    known = np.isfinite(ledger.residual).any() and np.isfinite(ledger.exchanged)
    part = f": the residual is {ledger.closure:.1e} of the exchanged energy" if known and ledger.exchanges else ""
    rows = in_rows(_ledger(view), 1)
    return [Panel(f"Energy ledger{part}", rows, every=len(rows))]


def tracking(view: View) -> list[Panel]:
    """Return the tracking error of each joint, or of the frame along each axis.

    Raises:
        PlotError: If the run followed no reference.
    """
    run = view.run
    if run.tracking_error is None:
        raise PlotError(
            "the run has no tracking error, because it has no reference; simulate it with a controller that has one"
        )
    if run.desired is None:
        columns, units = [0, 1, 2], ["m"] * 3
        axes = zip("xyz", run.tracking_error.T, strict=True)
        cells = [Cell(f"frame, {axis}", TIME, "p_d − p [m]", (Curve("error", run.t, y),)) for axis, y in axes]
    else:
        columns, units = list(view.joints), [view.unit("q", i) for i in view.joints]
        cells = [replace(_off(view, i), note="") for i in view.joints]
    off = run.tracking_error[:, columns]
    rms = {unit: _rms(off[:, [of_joint == unit for of_joint in units]]) for unit in dict.fromkeys(units)}
    heading = "Tracking error, rms " + ", ".join(f"{x:.2e} {unit}" for unit, x in rms.items())
    return [Panel(heading, in_rows(cells, view.columns))]


def phase(view: View) -> list[Panel]:
    """Return the phase portrait of each joint: v over q."""
    run, cells = view.run, []
    for i, name in zip(view.joints, view.names, strict=True):
        path = Curve("path", run.q[:, i], run.v[:, i])
        start = Curve("start", run.q[:1, i], run.v[:1, i], (1, 0))
        cells.append(Cell(name, f"q [{view.unit('q', i)}]", f"v [{view.unit('v', i)}]", (path, start)))
    return [Panel("Phase portrait", in_rows(cells, view.columns), 53.0)]


def error_growth(view: View) -> list[Panel]:
    """Return the estimated error of the positions, largest over the joints, and the time until which it is resolved.

    Raises:
        PlotError: If the run has no estimate.
    """
    error = view.run.error
    if error is None or len(error.t) < 2:
        why = "estimate_error was False" if error is None else error.note or "it ended too soon"
        raise PlotError(f"the run has no estimate of its error ({why}); simulate with estimate_error=True")
    return [Panel(f"Error of the positions: {error}", ((replace(_growth(view, error), title=""),),))]


PLOTS: Mapping[str, Callable[[View], list[Panel]]] = MappingProxyType(
    {f.__name__: f for f in (overview, joints, torques, energy, tracking, phase, error_growth)}
)


def _position(view: View, i: int, held: tuple[Rest, ...] = ()) -> Cell:
    run = view.run
    q = [Curve("actual", run.t, run.q[:, i])]
    if run.desired is not None:
        q.append(Curve("desired", run.t, run.desired[:, i], DESIRED))
    return Cell(run.joint_names[i], TIME, f"q [{view.unit('q', i)}]", tuple(q), marks=_marks(run, i), rests=held)


def _velocity(view: View, i: int, held: tuple[Rest, ...] = ()) -> Cell:
    run, limit = view.run, float(view.speeds[i])
    curves, y = (Curve("actual", run.t, run.v[:, i]),), f"v [{view.unit('v', i)}]"
    return Cell(run.joint_names[i], TIME, y, curves, limit=limit, marks=_marks(run, i), rests=held)


def _torque(view: View, i: int, held: tuple[Rest, ...] = ()) -> Cell:
    run, limit = view.run, float(view.efforts[i])
    every = run.u[:, i] if run.extremes is None else np.append(run.u[:, i], run.extremes[2, :, i])
    share = float(np.max(np.abs(every), where=np.isfinite(every), initial=0.0)) / limit
    used = "<1%" if 0 < share < 0.005 else f"{share:.0%}" if share < 10 else ">1000%"
    note = f"{used} of the limit" if np.isfinite(limit) else ""
    curves = (Curve("u", run.t, run.u[:, i]),)
    return Cell(run.joint_names[i], TIME, f"u [{view.unit('u', i)}]", curves, limit=limit, note=note)


def _off(view: View, i: int, held: tuple[Rest, ...] = ()) -> Cell:
    run, of_q = view.run, view.unit("q", i)
    off = np.zeros_like(run.t) if run.tracking_error is None else run.tracking_error[:, i]
    note = f"rms {_rms(off):.2e} {of_q}"
    return Cell(run.joint_names[i], TIME, f"q_d − q\n[{of_q}]", (Curve("error", run.t, off),), note=note)


def _ledger(view: View) -> list[Cell]:
    """Return the energies, the work of each source if any did work, and the residual."""
    t, ledger = view.run.t, view.run.ledger
    E, V = ledger.energy, ledger.potential
    own = (("K", ledger.kinetic), ("V − V(0)", V - V[0]), ("E − E(0)", E - E[0]))
    stores = tuple(Curve(label, t, y, (i, i)) for i, (label, y) in enumerate(own))
    works = tuple(  # repeated colours have other dashes
        Curve(f"W {name}", t, y, (k, k - 3 + 2 * (k // 7))) for k, (name, y) in enumerate(ledger.work.items(), 3)
    )
    sole = f" by {next(iter(ledger.work))}" if len(works) == 1 else ""
    left = Curve("|residual|", t, np.abs(ledger.residual))
    cells = [Cell("Energy since the start", TIME, "energy [J]", stores, own_legend=True)]
    if any(np.nan_to_num(work.y).any() for work in works):
        cells.append(Cell(f"Work since the start{sole}", TIME, "work [J]", works, own_legend=True))
    return [*cells, Cell("Residual |E − E(0) − Σ W|", TIME, "residual [J]", (left,), log=True)]


def _growth(view: View, error: ErrorEstimate) -> Cell:
    units = {unit("q", kind) for kind in view.types}
    of_q = units.pop() if len(units) == 1 else unit("q", None)
    until = error.until_s if error.until_s < error.t[-1] else np.inf
    curve = Curve("estimated error", error.t, error.error)
    return Cell("Estimated error |q − exact|", TIME, f"|q − exact| [{of_q}]", (curve,), log=True, until=until)


def _marks(run: TrajectoryData, i: int) -> tuple[float, ...]:
    return tuple(event.t for event in run.events if event.joint in ("", run.joint_names[i]))


def _legend(view: View, held: tuple[tuple[Rest, ...], ...]) -> str:
    """Return, for a heading, the meaning of marks that are not in the legend."""
    run, shown = view.run, [rest for i in view.joints for rest in held[i]]
    legend = [("events are dotted", run.events), ("where a joint is held is shaded", shown)]
    legend.append(("at a stop in colour", [rest for rest in shown if rest.at_stop]))
    return "".join(f"; {text}" for text, some in legend if some)


def _limits(view: View, **limits: np.ndarray) -> str:
    """Return the names of the drawn limits, for a heading."""
    shown = list(view.joints)
    peaks = {name: np.nan_to_num(np.abs(getattr(view.run, name)[:, shown])).max(axis=0) for name in limits}
    drawn = [name for name, x in limits.items() if ((peaks[name] > 0) & (peaks[name] >= NEAR * x[shown])).any()]
    return f"; limits of {' and '.join(drawn)} are dash-dotted where over {NEAR:.0%} is used" if drawn else ""


def _rms(z: np.ndarray) -> float:
    known = z[np.isfinite(z)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")
