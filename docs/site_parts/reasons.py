"""The page of reasons: the docstring of each member of `Reason`, and an example of its message."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from enum import Enum
from inspect import getsource
from textwrap import dedent
from typing import TypeVar

from robot_dyn.simulation import Outcome, Reason

E = TypeVar("E", bound=Enum)
_STEP = {"step_s": 0.002, "period_s": 0.01}
_LARGEST = {"largest": 3.2e101}
EXAMPLES = {
    Reason.TERMINAL_EVENT: {"event": "the tip touches the table"},
    Reason.CONTROL_LOOP_UNSTABLE: {
        "growth": "1.31", "period_s": 0.01, "start": 0.0, "over_run": "5.2e+11", "limit_s": 0.0062, "shorter_s": "0.003"
    },
    Reason.STEP_TOO_LONG: {
        "value": 0.01, "limit": 0.004, "method": "RK4", "step_s": "0.002",
        "motion": "changes", "rate_per_s": 710.0, "moving_joint": "elbow_joint", "source": "joint_stops",
    },
    Reason.IMPLAUSIBLE_SPEED: {"value": 640.0, "limit": 3.15, "unit": "rad/s", "step_s": 0.002},
    Reason.ENERGY_WITHOUT_SOURCE: _STEP,
    Reason.STATE_OVERFLOWS: _STEP,
    Reason.RATE_NOT_FINITE: _LARGEST,
    Reason.STEP_BELOW_FLOAT_SPACING: _LARGEST,
    Reason.STALLED: {
        "steps": 2600, "advanced_s": 3e-4, "remaining": 1e7,
        "remedy": "Rodas5P, softer effects or a larger tolerance",
    },
    Reason.STAGES_NOT_FOUND: {
        "error": "GaussLegendre4: the stages of the step 0.01 at t = 0.13 do not converge in 50 iterations: use a "
        "smaller step, or a method for stiff systems"
    },
    Reason.EVENTS_ACCUMULATE: {
        "changes": 1000, "span_s": 2.1e-10, "remedy": "method='MoreauJean' and a step_s"
    },
    Reason.TORQUE_NOT_FINITE: _STEP,
    Reason.CANNOT_EVALUATE: {
        "error": "line_spring_damper: its ends are at the same place, where it has no direction", **_STEP
    },
}  # fmt: skip
"""Facts of an example, by reason."""


def page(_: str) -> str:
    """What happened, what to do and an example message, for each reason."""
    return "\n".join(_page())


def docstrings(kind: type[E]) -> dict[E, str]:
    """Return the docstring of each member of an enumeration: the string after its assignment."""
    (tree,) = ast.parse(dedent(getsource(kind))).body
    assert isinstance(tree, ast.ClassDef)
    found = {}
    for name, text in zip(tree.body, tree.body[1:], strict=False):
        if isinstance(name, ast.Assign) and isinstance(text, ast.Expr):
            found[kind[ast.unparse(name.targets[0])]] = dedent("    " + ast.literal_eval(text.value)).strip()
    return found


def _page() -> Iterator[str]:
    texts = docstrings(Reason)
    for reason in Reason:
        example = Outcome(reason, 0.137, "elbow_joint", dict(EXAMPLES.get(reason, {})))
        yield f"## {reason}"
        yield ""
        yield f"`Reason.{reason.name}`, {example.ending}"
        yield ""
        yield texts[reason]
        yield ""
        if example.text:
            yield f"> {example.text}"
            yield ""
