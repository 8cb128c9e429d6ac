"""Proof of a theorem about the flow of a setup, step by step, as long as every bound holds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from time import perf_counter

from flint import ctx

from robot_dyn import Setup
from robot_dyn.foundations import Ball, JointValues, QueryError, duration, function, instance, integer, number
from robot_dyn.tools.proof.enclosure.balls import NotProvenError
from robot_dyn.tools.proof.enclosure.step import State, effort, proven_step
from robot_dyn.tools.proof.hypotheses import assumed, start
from robot_dyn.tools.proof.motion import Motion, motion
from robot_dyn.tools.proof.node import Node, node_of
from robot_dyn.tools.proof.tape import Tape
from robot_dyn.tools.proof.theorem import Proof

_LEAST_BITS, _MOST_BITS = 40, 4096
_LONGEST_S = 4096.0  # times up to this are exact


def prove(
    setup: Setup,
    until_s: float | None = None,
    bits: int = 100,
    *,
    q0: JointValues | None = None,
    v0: JointValues | None = None,
    width_q: float = 0.0,
    width_v: float = 0.0,
    budget_s: float = 60.0,
    on_progress: Callable[[float], object] | None = None,
) -> Proof:
    """Prove that the motion exists and is unique, and that q(t), v(t) lie in balls, for 0 ≤ t ≤ until_s.

    The theorem holds for the decimals of the URDF as written; floats of the setup (start, gravity, payloads,
    coefficients, gains) are exact binary numbers. The method and step of the setup are irrelevant.

    Args:
        setup: Plant, start, and optionally a continuous controller.
        until_s: End time, in [s]; by default the duration of the setup.
        bits: Precision of the balls, from 40 to 4096; more bits give smaller radii and shorter steps.
        q0: Initial position, (n,), that replaces the setup's: numbers, or strings for exact decimals.
        v0: Initial velocity, (n,), that replaces the setup's: numbers, or strings for exact decimals.
        width_q: Largest deviation of each initial q, in [rad] or [m], not negative.
        width_v: Largest deviation of each initial v, in [rad/s] or [m/s], not negative.
        budget_s: Limit on computing time, in [s].
        on_progress: Function called with the time reached, in [s], after each step.

    Returns:
        The theorem; if it ends before until_s, it states the reason.

    Raises:
        QueryError: If an argument is not allowed.
        ProofError: If a part of the setup switches, is sampled, or is user-defined; names that part.

    Source: Lohner 1987; Nedialkov, Jackson, Corliss 1999.
    """
    instance("setup", setup, Setup, "give a setup, for example rd.Setup(rd.Plant(robot), q0)")
    until_s = setup.duration_s if until_s is None else duration("until_s", until_s)
    if until_s > _LONGEST_S:
        raise QueryError(f"until_s must not exceed {_LONGEST_S:g} s, got {until_s:g}")
    bits = integer("bits", bits, least=_LEAST_BITS, most=_MOST_BITS)
    budget_s, began = duration("budget_s", budget_s), perf_counter()
    widths = number("width_q", width_q, least=0), number("width_v", width_v, least=0)
    function("on_progress", on_progress, "the time reached in [s]")
    about = motion(setup, until_s)
    with _precision(bits):
        state = start(about.robot.joint_names, (setup.q0 if q0 is None else q0, setup.v0 if v0 is None else v0), widths)
        nodes, why = [node_of(state)], ""
    try:
        for node in _nodes(about, state, until_s, bits):
            nodes.append(node)
            if on_progress is not None:
                on_progress(node.t)
            if perf_counter() - began > budget_s and node.t < until_s:
                raise NotProvenError(f"the budget of {budget_s:g} s is used up")
    except NotProvenError as error:
        why = str(error)
    arm = about.robot
    return Proof(
        robot=arm.name,
        joint_names=arm.joint_names,
        joint_types=arm.joint_types,
        requested_s=until_s,
        until_s=nodes[-1].t,
        why_not=why,
        bits=bits,
        assumed=assumed(about, setup, q0 is not None, v0 is not None, widths),
        nodes=tuple(nodes),
    )


def _nodes(about: Motion, state: State, until_s: float, bits: int) -> Iterator[Node]:
    """Yield the ends of proven steps in sequence; a step ends where a reference changes to another polynomial.

    Raises:
        NotProvenError: If no step can be proven beyond the last one.
    """
    how, before, tape = effort(bits), None, None
    for end in (*sorted(t for t in about.knots if 0 < t < until_s), until_s):
        if tape is None or about.knots:
            tape = Tape(about, float((state.t + Fraction(end)) / 2))
        while state.t < end:
            with _precision(bits):
                step = proven_step(tape, state, Fraction(end), how, before)
                state, before = step.end, step.h
                node = node_of(state, step)
            yield node


@contextmanager
def _precision(bits: int) -> Iterator[None]:
    """Set the precision of balls, and restore the length of power series afterwards."""
    with Ball(bits).scope():
        cap = ctx.cap
        try:
            yield
        finally:
            ctx.cap = cap
