"""Remarks on observations at every step: chatter, levels, torque–speed lines, coarse records, energy gains, creep."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.control.digital_loop.block import Noise, Quantisation
from robot_dyn.control.digital_loop.loop import Loop
from robot_dyn.effects.effect import Conservative, Dissipative, Stateful
from robot_dyn.effects.friction import RegularisedCoulombFriction
from robot_dyn.effects.torque_speed_limit import TorqueSpeedLimit
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.integrate.differences import by_state, rowwise
from robot_dyn.queries.units import joint_types_of, unit
from robot_dyn.simulation.diagnostics.reference_remarks import Units, held_by_friction, jumps
from robot_dyn.simulation.observation.observation import Observed
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.observation.remarks import Facts, Remark, RemarkKind
from robot_dyn.simulation.setup.setup import Setup

Remedy = Callable[[int, float], Facts]
"""A function of a run and of the start of its chatter, in [s], that returns the facts of the remedy."""
QUANTITIES = ("q", "v", "u")
KINDS = (
    RemarkKind.EFFORT_REACHED,
    RemarkKind.STOP_REACHED,
    RemarkKind.BEYOND,
)  # levels, in the order of a summary
_HIDDEN = 0.1  # fraction of the range of a quantity: least excess over the samples next to a window
_ROUNDING = 1e-9  # fraction of a quantity: a smaller range is noise
_LAST, _LEAST = 0.1, 5  # last part of a run, which is checked for creep, and least number of samples in it
_STEADY = 0.1  # fraction of a velocity: largest change there
_LOADED = 0.01, 0.96  # fractions of the level of friction: below, the joint rests; above, it slides


def remarks(
    setup: Setup,
    observer: Observer,
    observed: Observed,
    t: np.ndarray,
    samples: np.ndarray,
    power: dict[str, np.ndarray],
) -> tuple[Remark, ...]:
    """Return the remarks on the steps of a run, chatter first.

    Args:
        setup: The setup of the run.
        observer: Observer of the run, closed at its end.
        observed: Observations of the run.
        t: Times of its samples, (m,), in [s].
        samples: q, v and u side by side, (m, 3n).
        power: Power of each source, (m,), in [W].
    """
    units, n = units_of(joint_types_of(setup.plant.dynamics)), len(setup.q0)
    names, v = setup.plant.dynamics.joint_names, samples[:, n : 2 * n]
    return (
        *of_run(names, units, observed, lambda _, start: against(setup, t, samples[:, :n], start)),
        *_on_lines(setup, t, v, samples[:, 2 * n :], units),
        *_coarse(setup, observer, t, samples, units), *_gaining(setup, t, power),
        *_creeping(setup, t, v, units), *of_reference(setup, t, observed.extremes[0], units),
    )  # fmt: skip


def of_reference(setup: Setup, t: np.ndarray, extremes: np.ndarray, units: Units) -> Iterator[Remark]:
    """Yield remarks on the reference of a run, with extremes (3, 2, n) of its steps and samples at times t (m,)."""
    yield from (remark for remark, _ in jumps(setup, setup.q0[None], setup.v0[None], units))
    yield from held_by_friction(setup, extremes, t, units)


def of_run(names: tuple[str, ...], units: Units, observed: Observed, remedy: Remedy) -> list[Remark]:
    """Return the remarks of `of_runs` on a single run; those on levels in the order of time."""
    remarks = [remark for remark, _, _ in of_runs(names, units, observed, remedy)]
    chatter = [remark for remark in remarks if remark.kind is RemarkKind.CHATTER]
    return chatter + sorted(remarks[len(chatter) :], key=lambda remark: (KINDS.index(remark.kind), remark.start_s))


def of_runs(
    names: tuple[str, ...], units: Units, observed: Observed, remedy: Remedy
) -> Iterator[tuple[Remark, int, np.ndarray]]:
    """Yield remarks on the observations of B runs by joint and quantity: chatter, then levels.

    Each is about the worst run; it comes with the index of that run, and True for each run that is affected, (B,).

    Args:
        names: Names of the joints.
        units: Units of the joints, see `units_of`.
        observed: Observations of the runs.
        remedy: Facts of the remedy for chatter.
    """
    amplitudes = observed.episodes[:, :, 2]
    for joint in np.argsort(-amplitudes.max(axis=0)).tolist():
        if amplitudes[:, joint].any():
            worst = int(amplitudes[:, joint].argmax())
            start, duration, amplitude = observed.episodes[worst, joint].tolist()
            facts: dict[str, float | str] = {**remedy(worst, start), "unit": units[joint][2]}
            remark = Remark(RemarkKind.CHATTER, names[joint], "u", start, duration, start, amplitude, None, facts=facts)
            yield remark, worst, amplitudes[:, joint] > 0
    places = {(level.kind, level.row) for level in observed.levels}
    for kind, row in sorted(places, key=lambda place: (KINDS.index(place[0]), place)):
        both = [k for k, level in enumerate(observed.levels) if (level.kind, level.row) == (kind, row)]
        _, duration, _, value = np.moveaxis(observed.visits[:, both], 2, 0)
        some = ~np.isnan(duration).all(axis=1)
        if some.any():
            beyond = np.abs(value - observed.limits[:, both])
            size = np.nansum(duration, axis=1) if kind is RemarkKind.EFFORT_REACHED else np.fmax.reduce(beyond, axis=1)
            worst = int(np.nanargmax(np.where(some, size, np.nan)))
            yield _passed(names, units, observed, both, worst), worst, some


def _gaining(setup: Setup, t: np.ndarray, power: dict[str, np.ndarray]) -> Iterator[Remark]:
    """Yield effects declared dissipative with τᵀv > 0 at a sample, by more than rounding."""
    working = [force for force in setup.plant.forces if not isinstance(force, Conservative)]
    for force, (name, P) in zip(working, list(power.items())[1:], strict=False):  # after the control, see `sources`
        dissipates = isinstance(force, Dissipative) and not isinstance(
            force, Stateful
        )  # effects with states may return stored energy
        if not dissipates or not (np.nan_to_num(P) > _ROUNDING * np.nanmax(np.abs(P))).any():
            continue
        at = int(np.nanargmax(P))
        yield Remark(RemarkKind.GAINS, name, "power", float(t[at]), 0.0, float(t[at]), float(P[at]), 0.0)


def _on_lines(setup: Setup, t: np.ndarray, v: np.ndarray, u: np.ndarray, units: Units) -> Iterator[Remark]:
    """Yield motors that are at their torque–speed line at samples, with v and u (m, n)."""
    half = np.diff(t, prepend=t[:1], append=t[-1:]) / 2
    weights = half[:-1] + half[1:]
    for effect in setup.plant.effects:
        if not isinstance(effect, TorqueSpeedLimit):
            continue
        at_line = (np.abs(effect.limited(u, v)) >= 1 - _ROUNDING) & effect.is_limited
        for i in np.flatnonzero(at_line.any(axis=0)):
            rows = np.flatnonzero(at_line[:, i])
            k = rows[np.abs(v[rows, i]).argmax()]
            _, of_v, of_u = units[i]
            facts: dict[str, float | str] = {"unit": of_u, "unit_of_v": of_v, "speed": float(abs(v[k, i]))}
            times = float(t[rows[0]]), float(weights[rows].sum()), float(t[k])
            name = setup.plant.dynamics.joint_names[i]
            yield Remark(RemarkKind.LINE_REACHED, name, "u", *times, float(u[k, i]), None, facts=facts)


def _creeping(setup: Setup, t: np.ndarray, v: np.ndarray, units: Units) -> Iterator[Remark]:
    """Yield joints that creep at the end of a run: with regularised friction f, v = v_s artanh(τ / f) if τ < f."""
    late = t >= t[-1] - _LAST * setup.duration_s
    if late.sum() < _LEAST:
        return
    v, start = v[late], float(t[late][0])
    lasted, mean = float(t[-1]) - start, v.mean(axis=0)
    steady = np.ptp(v, axis=0) < _STEADY * np.abs(mean)
    for effect in setup.plant.effects:
        if not isinstance(effect, RegularisedCoulombFriction):
            continue
        level, part = np.broadcast_to(effect.coulomb, mean.shape), np.abs(np.tanh(mean / effect.velocity_scale))
        for i in np.flatnonzero(steady & (level > 0) & (part > _LOADED[0]) & (part < _LOADED[1])):
            name, (_, of_v, of_u) = setup.plant.dynamics.joint_names[i], units[i]
            facts: dict[str, float | str] = {
                "unit": of_v,
                "unit_of_u": of_u,
                "load": float(part[i] * level[i]),
                "level": float(level[i]),
            }
            yield Remark(RemarkKind.CREEPS, name, "v", start, lasted, float(t[-1]), float(mean[i]), None, facts=facts)


def units_of(joint_types: Iterable[str | None]) -> Units:
    """Return the units of q, v and u of each joint."""
    return [(unit("q", kind), unit("v", kind), unit("u", kind)) for kind in joint_types]


def _passed(names: tuple[str, ...], units: Units, observed: Observed, both: list[int], run: int) -> Remark:
    """Return the remark on the levels of a quantity that a run has passed, `both` sides of a limit as one."""
    level, limits = observed.levels[both[0]], observed.limits[run]
    quantity, joint = divmod(level.row, len(units))
    visits = [(*observed.visits[run, k].tolist(), float(limits[k])) for k in both if observed.visits[run, k, 0] >= 0]
    visits.sort(key=lambda visit: visit[0])
    _, _, at, value, limit = max(visits, key=lambda visit: abs(visit[3] - visit[4]))
    duration = sum({limit: duration for _, duration, _, _, limit in visits}.values())  # both sides of 0 are one
    facts: dict[str, float | str] = {"unit": units[joint][quantity]}
    if QUANTITIES[quantity] == "u" and observed.instants[run]:
        facts["instants"] = int(observed.instants[run])
    of_joint = level.kind, names[joint], QUANTITIES[quantity]
    return Remark(*of_joint, visits[0][0], duration, at, value, limit, facts=facts)


def against(setup: Setup, t: np.ndarray, q: np.ndarray, start: float) -> Facts:
    """Return the facts of the remedy for chatter: the step, or the period and, if it explains the chatter, kd T/M.

    The largest kd T/M is the eigenvalue of −M⁻¹ ∂u/∂v times T.

    Args:
        setup: The setup of the run.
        t: Times of samples, (m,), in [s].
        q: Positions there, (m, n).
        start: Start of the chatter, in [s].
    """
    period = setup.controller.period_s if setup.controller else 0.0
    if not period:
        return {"step_s": setup.taken_step_s}
    general, q = {"period_s": period}, q[np.clip(np.searchsorted(t, start), 0, len(t) - 1)]
    controller = setup.controller.controller if isinstance(setup.controller, Loop) else setup.controller
    assert controller is not None
    z, v = np.zeros(controller.state_size), np.zeros(len(q))
    try:
        with np.errstate(all="ignore"):
            slope = by_state(rowwise(lambda v: controller.torque(start, q, v, z)), start, v).T
            M = setup.plant.at(start).M(q)
            ratio = float(np.abs(np.linalg.eigvals(np.linalg.solve(M, -slope))).max()) * period
    except (RobotDynError, np.linalg.LinAlgError):
        return general
    if ratio <= 1 and (blocks := _of_sensors(setup.controller)):
        return {"ratio": ratio, "blocks": " and ".join(blocks)}
    return {"ratio": ratio, "longest_s": period / ratio} if 1 < ratio < np.inf else general


def _of_sensors(controller: Controller | None) -> tuple[str, ...]:
    """Return the kinds of blocks in the measurement of a loop that make it change from tick to tick."""
    blocks = (*controller.position, *controller.velocity) if isinstance(controller, Loop) else ()
    kinds = {Quantisation: "quantisation", Noise: "noise"}
    return tuple(dict.fromkeys(name for block in blocks for kind, name in kinds.items() if isinstance(block, kind)))


def _coarse(setup: Setup, observer: Observer, t: np.ndarray, samples: np.ndarray, units: Units) -> Iterator[Remark]:
    """Yield the worst excess of q, v or u of each joint over neighbouring samples, if large relative to the range."""
    edges, low, high = observer.windows
    every = not setup.record_every_s and not setup.method.controls_error
    if every or not len(low) or not len(t):
        return
    spacing = 1e-9 * (t[-1] - t[0])
    first = np.clip(np.searchsorted(t, edges[:-1] + spacing, "right") - 1, 0, None)
    last = np.maximum(np.clip(np.searchsorted(t, edges[1:] - spacing), 0, len(t) - 1), first) + 1
    padded, pairs = np.vstack([samples, samples[-1:]]), np.column_stack([first, last]).ravel()
    with np.errstate(all="ignore"):
        least, largest = (extreme.reduceat(padded, pairs)[::2] for extreme in (np.minimum, np.maximum))
        above, below = high - largest, least - low
        bottom, top = low.min(axis=0), high.max(axis=0)
        noise = _ROUNDING * np.maximum(1.0, np.maximum(np.abs(bottom), np.abs(top)))
        part = np.where(top - bottom > noise, np.maximum(above, below) / (top - bottom), 0.0)
    part = np.nan_to_num(part)
    n, names = len(units), setup.plant.dynamics.joint_names
    worst = part.max(axis=0).reshape(3, n)
    for joint in np.flatnonzero(worst.max(axis=0) > _HIDDEN):
        row = int(worst[:, joint].argmax()) * n + int(joint)
        window = int(part[:, row].argmax())
        up = above[window, row] > below[window, row]
        value, shown = (high, largest) if up else (low, least)
        start, end, quantity = float(edges[window]), float(edges[window + 1]), QUANTITIES[row // n]
        numbers = (start + end) / 2, float(value[window, row]), float(shown[window, row])
        facts: dict[str, float | str] = {"unit": units[joint][row // n]}
        yield Remark(RemarkKind.COARSE, names[joint], quantity, start, end - start, *numbers, facts)
