"""Why the energy ledger of a run does not close: work that nothing books, stops passed within a step, or long steps.

dE/dt = Σ P_k   at every state, whatever the steps, if all work is booked;   E(t) − E(0) = Σ W_k(t) if steps are short
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robot_dyn.effects.effect import Conservative
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import RobotDynError, call
from robot_dyn.simulation.diagnostics.missed_events import cut_alike, stepped_over
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.results.ledger import largest
from robot_dyn.simulation.results.samples import columns, ledger
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.setup.setup import Setup

_LOOKS = 100  # at samples
_WITHIN = 1e-4  # [rad], [m], [rad/s], [m/s]: by which a state is moved along its motion, for dE/dt
_UNBOOKED = 1e-3  # of the powers
_FINER, _TIGHTER = 4, 100  # times as short steps, as small a tolerance


def cause(setup: Setup, run: Recording, contradicts: bool) -> str:
    """Why the ledger of a run does not close, and what to do.

    Args:
        setup: What was run.
        run: What it left behind.
        contradicts: Whether it closes, but not as well as the estimated error of q implies.
    """
    if run.outcome.ending is Ending.DIVERGED:
        return "the run diverged"
    if unbooked := _unbooked(setup.equation, run):
        return unbooked
    method: Any = setup.method
    doubt = "do not trust the estimate, " if contradicts else ""
    if method.controls_error:
        return f"{doubt}the tolerance is too loose; take rtol = {method.rtol / _TIGHTER:.0e}"
    missed = stepped_over(setup, run.step_log, 0.0) or cut_alike(setup, run)
    why = "the steps are too long for the motion" if missed is None else f"{missed.why}, at t = {missed.t:.4g} s"
    return f"{doubt}{why}; take step_s = {setup.taken_step_s / _FINER:.0e}"


def _unbooked(equation: StateEquation, run: Recording) -> str:
    """What changes the energy beside the powers, at the sample where it does most; empty if that is not the cause.

    A sample at which dE/dt jumps, as at a stop, shows nothing. Payloads that come and go change what the energy is of.
    """
    if equation.equation_of_motion.payloads:
        return ""
    rows = np.unique(np.linspace(0, len(run.t) - 1, _LOOKS).astype(int))
    t, y = run.t[rows], run.y[rows]
    q, v, a, _, _, P, _ = columns(equation, t, y, run.sampled[rows])
    worst = largest(np.abs(ledger(equation, run).residual)) / float(run.t[-1]) / 2  # on average, to leave the residual
    advice = ""
    for k in range(len(t)):
        state = float(t[k]), q[k], v[k], a[k]
        try:
            before, after = (_slope(lambda *at: sum(equation.energies(*at)), state, side) for side in (-1, 1))
            flows = _slope(lambda *at: equation.energies(*at)[0], state, 1)
        except RobotDynError:
            continue
        left = (before + after) / 2 - float(P[k].sum())
        noticed = abs(left) > _UNBOOKED * (abs(flows) + float(np.abs(P[k]).sum()))
        if noticed and abs(left) > worst and abs(after - before) < abs(left) / 2:
            worst, advice = abs(left), _named(equation, state, left)
    return advice


def _slope(energy: Any, state: tuple[float, Array, Array, Array], side: float) -> float:
    """The rate of an energy of (t, q, v) along the motion, by a difference to one side."""
    t, q, v, a = state
    s = side * _WITHIN / (1 + float(max(np.abs(v).max(), np.abs(a).max())))
    return float((energy(t + s, q + s * v, v + s * a) - energy(t, q, v)) / s)


def _named(equation: StateEquation, state: tuple[float, Array, Array, Array], left: float) -> str:
    """The part whose work is not booked, as far as it is known."""
    t, q, v, _ = state
    dynamics, motion = equation.plant.dynamics, equation.equation_of_motion
    for force in motion.forces:
        if not isinstance(force, Conservative):
            continue
        slope = _slope(lambda t, q, v, force=force: call(force.potential, dynamics, t, q), state, 1)
        if abs(slope + float(call(force.torque, dynamics, t, q, v) @ v)) > abs(left) / 2:
            return (
                f"{force.name} does {-left:.2g} W at t = {t:.4g} s that its potential does not give; its torque must be"
                " −∂E/∂q of a potential E(q), otherwise declare it Active"
            )
    return (
        f"{-left:.2g} W at t = {t:.4g} s are work of no effect; M, C and N of the dynamics must belong to its energies,"
        " and none of them may depend on time"
    )
