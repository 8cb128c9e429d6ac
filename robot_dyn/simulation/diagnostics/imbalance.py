"""The cause of an energy ledger that does not close: unbooked work, stops passed within a step, or long steps.

dE/dt = Σ P_k   at every state, for steps of any length, if all work is booked
E(t) − E(0) = Σ W_k(t)   if the steps are short
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robot_dyn.effects.effect import Conservative
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import RobotDynError, call
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.simulation.diagnostics.missed_events import cut_alike, stepped_over
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.results.doubts import Doubt, DoubtKind
from robot_dyn.simulation.results.ledger import largest
from robot_dyn.simulation.results.samples import columns, ledger
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.setup.setup import Setup

_CHECKED = 100  # samples
_WITHIN = 1e-4  # [rad], [m], [rad/s], [m/s]: displacement of a state along its motion, for dE/dt
_UNBOOKED = 1e-3  # fraction of the powers
_FINER, _TIGHTER = 4, 100  # factors of a smaller step and of a smaller tolerance

_State = tuple[float, Array, Array, Array]  # t, q, v, a


def cause(setup: Setup, run: Recording) -> Doubt:
    """Return why the ledger of a run does not close, or not as well as its estimated error implies."""
    if run.outcome.ending is Ending.DIVERGED:
        return Doubt(DoubtKind.DIVERGED)
    if (unbooked := _unbooked(setup.equation, run)) is not None:
        return unbooked
    if setup.method.controls_error:
        return finer(setup, Doubt(DoubtKind.LOOSE_TOLERANCE))
    for onset in (stepped_over(setup, run.step_log, 0.0), cut_alike(setup, run)):
        if onset.doubt is not None:
            return finer(setup, Doubt(onset.doubt.kind, onset.doubt.facts | {"at": onset.t}))
    return finer(setup, Doubt(DoubtKind.LONG_STEPS))


def finer(setup: Setup, doubt: Doubt) -> Doubt:
    """Return a doubt with a smaller step or tolerance as its remedy."""
    method = setup.method
    if isinstance(method, Adaptive):
        return Doubt(doubt.kind, doubt.facts | {"smaller_rtol": method.rtol / _TIGHTER})
    return Doubt(doubt.kind, doubt.facts | {"smaller_step_s": setup.taken_step_s / _FINER})


def _unbooked(equation: StateEquation, run: Recording) -> Doubt | None:
    """Return the largest change of energy at a sample that no power explains; None if that is not the cause.

    Samples at which dE/dt jumps, for example at a stop, are ignored. So are runs with payloads, whose attachment
    changes the energy.
    """
    if equation.equation_of_motion.payloads:
        return None
    rows = np.unique(np.linspace(0, len(run.t) - 1, _CHECKED).astype(int))
    t, y = run.t[rows], run.y[rows]
    q, v, a, _, _, P, _ = columns(equation, t, y, run.sampled[rows])
    worst = largest(np.abs(ledger(equation, run).residual)) / float(run.t[-1]) / 2  # mean power of half the residual
    doubt = None
    for k in range(len(t)):
        state = float(t[k]), q[k], v[k], a[k]
        try:
            before, after = (_slope(lambda *at: sum(equation.energies(*at)), state, side) for side in (-1, 1))
            flows = _slope(lambda *at: equation.energies(*at)[0], state, 1)
        except RobotDynError:
            continue
        missing = (before + after) / 2 - float(P[k].sum())
        noticed = abs(missing) > _UNBOOKED * (abs(flows) + float(np.abs(P[k]).sum()))
        if noticed and abs(missing) > worst and abs(after - before) < abs(missing) / 2:
            worst, doubt = abs(missing), _named(equation, state, missing)
    return doubt


def _slope(energy: Callable[[float, Array, Array], Array | int], state: _State, side: float) -> float:
    """Return the rate of an energy of (t, q, v) along the motion, by a difference to one side."""
    t, q, v, a = state
    s = side * _WITHIN / (1 + float(max(np.abs(v).max(), np.abs(a).max())))
    return float((energy(t + s, q + s * v, v + s * a) - energy(t, q, v)) / s)


def _named(equation: StateEquation, state: _State, missing: float) -> Doubt:
    """Return the doubt about the part whose work is not booked, if it is known."""
    t, q, v, _ = state
    dynamics, motion = equation.plant.dynamics, equation.equation_of_motion
    facts: dict[str, float | str] = {"power": -missing, "at": t}
    for force in motion.forces:
        if not isinstance(force, Conservative):
            continue
        slope = _slope(lambda t, q, v, force=force: call(force.potential, dynamics, t, q), state, 1)
        if abs(slope + float(call(force.torque, dynamics, t, q, v) @ v)) > abs(missing) / 2:
            return Doubt(DoubtKind.WORK_OF_POTENTIAL, facts | {"effect": force.name})
    return Doubt(DoubtKind.WORK_OF_NO_EFFECT, facts)
