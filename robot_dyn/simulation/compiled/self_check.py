"""The self-check of machine code: a comparison with the interpreted equations before its first use.

    |y' − y'_interpreted| ≤ 1e-13 · cond(M) · scale   at states of the run or at random states; otherwise MachineError

The Jacobian is compared with differences of the interpreted equation. Differences over two spans show their own error,
which comes from rounding, or from a kink within the span.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import RobotDynError, located_message
from robot_dyn.integrate.differences import INSIDE, by_state, by_time, rowwise
from robot_dyn.integrate.primitives import evaluate
from robot_dyn.model.right_angles import with_exact_models
from robot_dyn.simulation.compiled.cache import robot_to_compile
from robot_dyn.simulation.compiled.machine_code import STEP, MachineCode, States
from robot_dyn.simulation.dynamics.moreau_jean import stepped
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.interpreted import Interpreted, sample
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.run.recording import Path, Recording
from robot_dyn.simulation.run.run import Run
from robot_dyn.simulation.setup.segment_table import segment_table
from robot_dyn.simulation.setup.setup import Setup

_LANES = 4  # runs in lock step that are compared
_AGREES = 1e-13
_LENGTH = 1e-3  # [s], of a step that is compared

_RANDOM = 4  # states
_FIRST_S, _MOST = 1.0, 2000  # part of a run that is interpreted first, in [s], and evaluations for it, about 0.2 s
_ALONG, _AT_TIMES = 100, 100  # states of the first second, and states at random times of the whole run
_AGAIN = 4  # half the number of states before a later run
_TRIES = 4  # number of spans, each a tenth of the previous one; then only the start is compared

_DIFFERENCES = 1e-6  # relative to a column: differences are right to some 1e-10 of f, over columns of other units
_NARROWER = 4.0
_DOUBT, _ROUNDINGS = 30.0, 300.0  # multiples of the rounding of f, where forces cancel

Pairs = Iterator[tuple[Array, Array]]  # a result of machine code, and that of the interpreted equation


class MachineError(RobotDynError):
    """Machine code that does not agree with the interpreted equations; it is not used."""


class _Evaluated(NamedTuple):
    """Results of the functions at one time, in W lanes.

    Attributes:
        t: Time, in [s].
        y: States, (m, W).
        p: Numbers of the segment.
        run_parameters: Parameters of each lane, (O, W).
        results: Results of the functions by name, without those of a nonsmooth step, (size, W) each.
    """

    t: float
    y: Array
    p: Array
    run_parameters: Array
    results: Mapping[str, Array]

    def held(self, equation: StateEquation, lane: int) -> Array | None:
        """Return the actuation of a lane in zero-order hold; None for a continuous controller."""
        return self.run_parameters[: equation.plant.dynamics.n, lane] if equation.sampled else None


def check(code: MachineCode, setup: Setup) -> None:
    """Compare machine code with the interpreted equations.

    If all parts are of this library, code is compared once, at random states. With user-defined parts, it is compared
    at states of the first second of the first run, and at some of these states before each later run.

    Raises:
        MachineError: If the results differ by more than rounding.
    """
    checked, changeable = code.code.checked, code.code.changeable
    controller = with_exact_models(code.compiled_form.controller, robot_to_compile)  # as they are traced
    if controller is not code.compiled_form.controller:
        code = replace(code, compiled_form=replace(code.compiled_form, controller=controller))
    states = next(iter(checked.values()), None)
    if states is None:
        states = _states_of_run(setup) if changeable else _random_states(setup, code.compiled_form.size)
        _compare(code, setup, states)
    elif changeable:
        _compare(code, setup, _some(states))
    checked[code.machine_loop] = states


def _compare(code: MachineCode, setup: Setup, states: States) -> None:
    rng, equation, functions = np.random.default_rng(20), code.compiled_form, code.code
    W, table, held = functions.runs, segment_table(setup), equation.plant.dynamics.n * equation.sampled
    results = {name: np.empty((functions.programs.results(name), W)) for name in functions.programs}
    swept = {x.name: np.tile(x.value.ravel(), (W, 1)) for x in code.inputs if x.name in code.swept}
    run_parameters = code.run_parameters(swept)
    for i, time in enumerate(states.t.tolist()):
        p = table.parameters[int(np.searchsorted(table.starts[:-1], time, side="right")) - 1]
        t, y = min(max(time, p[0]), p[1]), np.ascontiguousarray(states.y[(i + np.arange(W)) % len(states.y)].T)
        run_parameters[:held] = rng.normal(size=(held, W))
        for name, out in results.items():
            if name not in STEP:
                getattr(code.in_python, name)(t, y, p, run_parameters, out)
        at = _Evaluated(t, y, p, run_parameters, results)
        try:
            for lane in range(min(W, _LANES)):
                _compare_lane(code, at, lane)
        except RobotDynError:
            raise
        except Exception as error:  # raised by user-defined code
            parts = " or ".join(functions.changeable)
            raise MachineError(f"{parts} raises at t = {round(t, 9):g} s ({located_message(error)})") from error
        if "jacobian" in results:
            J = results["jacobian"][:, 0].reshape(equation.size + 1, equation.size)
            worst = jacobian_error(equation, t, y[:, 0], at.held(equation, 0), p, J)
            if not worst <= 1:
                raise _differs(code, "Jacobian", worst * _DIFFERENCES, _DIFFERENCES, t)


def _compare_lane(code: MachineCode, at: _Evaluated, lane: int) -> None:
    """Compare all results of one lane."""
    pairs = [*_results_of_lane(code, at, lane)]
    if "problem" in at.results and not lane:
        pairs += _results_of_step(code, at)
    y, plant = at.y[:, lane], code.compiled_form.plant
    allowed = _AGREES * max(1.0, float(np.linalg.cond(plant.M(y[: plant.dynamics.n]))))
    worst = max(_difference(*pair, y) for pair in pairs)
    if not worst <= allowed:
        raise _differs(code, "state equation", worst, allowed, at.t)


def _results_of_lane(code: MachineCode, at: _Evaluated, lane: int) -> Pairs:
    """Yield the results of a lane, quantity by quantity, with those of the interpreted equation."""
    equation, t, y, held = code.compiled_form, at.t, at.y[:, lane], at.held(code.compiled_form, lane)
    ours, single = {name: out[:, lane] for name, out in at.results.items()}, code.code.runs == 1
    n, m = equation.plant.dynamics.n, equation.size
    theirs = np.empty(m + n + 2)
    sample(equation, t, y, held, theirs)
    rate, u, energy = np.split(theirs, [m, m + n])
    yield ours["energy"], energy
    if "rate" in ours:
        yield ours["rate"][:m], rate
    if "rate" in ours and single:
        yield ours["rate"][m:], u
        yield from zip(np.split(ours["sample"], [m, m + n]), (rate, u, energy), strict=True)
    if "actuation" in ours:
        yield ours["actuation"], u
    if "events" in ours:
        yield ours["events"], equation.event_values(t, y, held)
    if "bodies" in ours:
        both = ours["bodies"], equation.bodies(t, y, held)
        yield from zip(*(np.split(x, [n * n]) for x in both), strict=True)
    if "tick" in ours:
        after, command = equation.tick(t, y)
        yield ours["tick"][:n], np.asarray(command)
        yield ours["tick"][n:], after[2 * n : 2 * n + equation.state_size]


def _results_of_step(code: MachineCode, at: _Evaluated) -> Pairs:
    """Yield y⁺, v⁺ and its places after a step of Moreau and Jean, lane by lane, with those of the equation."""
    equation, (m, W) = code.compiled_form, at.y.shape
    n = equation.plant.dynamics.n
    x = np.vstack([at.y, np.full((1, W), _LENGTH), np.zeros((n, W))])
    out = np.empty((m + 2 * n + 1 + code.code.programs.results("problem"), W))
    evaluate(code.in_python.step, at.t, x, at.p, at.run_parameters, out)
    for lane in range(min(W, _LANES)):
        theirs = stepped(equation, at.t, x[:, lane], at.held(equation, lane))
        yield out[:m, lane], theirs[:m]
        yield out[m : m + 2 * n, lane], theirs[m : m + 2 * n]


def _difference(x: Array, y: Array, start: Array) -> float:
    """Return the largest difference of x and y, relative to the largest number of y and of the state `start`."""
    size = max(float(np.abs(y).max(initial=1.0)), float(np.abs(start).max()))
    return float(np.abs(x - y).max(initial=0.0) / size) if np.isfinite(x).all() and np.isfinite(y).all() else np.inf


def _differs(code: MachineCode, function: str, worst: float, allowed: float, t: float) -> MachineError:
    subject, remedy = f"of {code.code.name}", "take engine='interpreted', and report it"
    if parts := code.code.changeable:
        subject = f"with {' or '.join(parts)}"
        remedy = (
            "methods must be functions of their arguments and of the fields of their part; take"
            " engine='interpreted', or create a part again that was changed after a run"
        )
    return MachineError(
        f"the compiled {function} {subject} differs from the interpreted one by {worst:.1e} of its size at"
        f" t = {round(t, 9):g} s, {allowed:.1e} allowed: {remedy}"
    )


def _random_states(setup: Setup, size: int) -> States:
    """Return random states of `size` entries, at a time in each of several random segments of a run."""
    rng, table = np.random.default_rng(20), segment_table(setup)
    segments = rng.integers(len(table.counts) - 1, size=_RANDOM)
    return States(table.starts[segments] + table.lengths[segments], rng.normal(size=(_RANDOM, size)))


def _states_of_run(setup: Setup) -> States:
    """Return states of the first second of a run, at their own times and again at random times of the whole run.

    They are midpoints of steps, because rates may have kinks at the ends of steps. The random times show code whose
    trace is right at early times only.
    """
    path = _first_second(setup)
    ends = np.unique(np.linspace(0, max(len(path.t) - 2, 0), _ALONG).astype(int))
    after = np.minimum(ends + 1, len(path.t) - 1)
    t, y = (path.t[ends] + path.t[after]) / 2, (path.y[ends] + path.y[after]) / 2
    times = np.random.default_rng(20).uniform(0.0, setup.duration_s, size=_AT_TIMES)
    return States(np.append(t, times), np.vstack([y, y[np.resize(np.arange(len(y)), _AT_TIMES)]]))


def _some(states: States) -> States:
    """Return some of these states, with the first and the last."""
    rows = np.unique(np.linspace(0, len(states.t) - 1, 2 * _AGAIN).astype(int))
    return States(states.t[rows], states.y[rows])


def _first_second(setup: Setup) -> Path:
    """Return the first second of a run by the interpreted engine; a shorter part if it needs too many evaluations."""
    span = min(setup.duration_s, _FIRST_S)
    if not setup.method.controls_error:
        span = min(span, _MOST / (setup.method.evaluations_per_step or 1) * setup.taken_step_s)
    for _ in range(_TRIES):
        short = replace(
            setup, duration_s=span, record_every_s=0.0, estimate_error=False, accuracy=None, engine="interpreted"
        )
        record = Run(short, Interpreted(short.equation), samples=False, max_evaluations=_MOST).run()
        if not isinstance(record, Recording):
            span /= 10
            continue
        if record.outcome.ending is Ending.STOPPED:
            raise KeyboardInterrupt
        return record.step_log
    return Path(np.zeros(1, np.int64), np.zeros(1), setup.equation.start(setup.q0, setup.v0)[None])


def jacobian_error(equation: StateEquation, t: float, y: Array, held: Array | None, p: Array, J: Array) -> float:
    """Return the largest ratio of the difference between a Jacobian and differences to the allowed one; ≤ 1 to agree.

    Args:
        equation: The interpreted state equation.
        t: Time within the segment.
        y: State, (m,).
        held: The actuation in zero-order hold, or None.
        p: Numbers of the segment.
        J: ∂f/∂y_j for each j, then ∂f/∂t, (m + 1, m).
    """

    def f(at: Any, states: Array) -> Array:
        time = min(max(float(at), p[0]), p[1])
        return rowwise(lambda row: equation.rate(time, row, held)[0])(at, states)

    span = np.cbrt(np.finfo(float).eps)
    widths, ahead = np.minimum(equation.widths, span * np.maximum(1.0, np.abs(y)) / INSIDE), 2 * span * max(1.0, abs(t))
    ahead = min(ahead, p[1] - t) if t - p[0] < p[1] - t else max(-ahead, p[0] - t)
    wide, narrow = (
        np.vstack([by_state(f, t, y, scale * widths), by_time(f, t, y, t + scale * ahead)[None]])
        for scale in (1.0, 1 / _NARROWER)
    )
    rounding = _ROUNDINGS * np.finfo(float).eps * np.abs(f(t, y)).max() / span
    doubt = _DOUBT * np.abs(wide - narrow).max(axis=1) + rounding
    allowed = _DIFFERENCES * np.maximum(1.0, np.abs(narrow).max(axis=1)) + doubt
    far = np.abs(J - wide).max(axis=1)
    return float((far / allowed).max()) if np.isfinite(J).all() else np.inf
