"""Where stability bounds the steps of an explicit method that chooses them, h |λ| ≈ 6: a stiff method is faster.

[Hairer, Wanner 1996, IV.2, p. 21]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.integrate.adaptive import EXPLICIT, STIFF
from robot_dyn.simulation.dynamics.fastest_motion import Fastest, fastest
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.observation.remarks import Remark, RemarkKind
from robot_dyn.simulation.run.outcome import Stiff
from robot_dyn.simulation.setup.setup import Setup

_BOUND = (4.0, 9.0)  # h |λ| of explicit steps that stability bounds: by 6.1 for DOP853, about which they go up and down
_WORTH = 1000  # steps still to be made for which starting again is worthwhile
FIRST_LOOK = 500  # steps of a run whose method is to be chosen, then after as many again as there were
_MEAN = 20  # steps whose mean length is looked at


def changes_over(setup: Setup, equation: StateEquation, ends: Array, y: Array, held: Array | None) -> Stiff | None:
    """Why a stiff method is to make a run: stability bounds its latest steps, and many more would follow; else None.

    Args:
        setup: What is run.
        equation: The state equation where the run is.
        ends: Ends of its steps so far, in [s].
        y: The state at the last of them.
        held: The actuation in zero-order hold, or None.
    """
    t, h = float(ends[-1]), float(ends[-1] - ends[-1 - _MEAN]) / _MEAN
    if h * _WORTH > setup.duration_s - t:
        return None
    try:
        motion = fastest(equation, t, y, held)
    except (RobotDynError, np.linalg.LinAlgError):
        return None
    remedy = f"made by {STIFF} in place of {EXPLICIT}"
    return Stiff(remark(motion, 0.0, t, t, remedy)) if bounds(motion, h) else None


def bounds(motion: Fastest, h: float) -> bool:
    """Whether stability bounds explicit steps of length h."""
    return motion.decays and _BOUND[0] < abs(motion.eigenvalue) * h < _BOUND[1]


def remark(motion: Fastest, start: float, end: float, at: float, remedy: str) -> Remark:
    """That stability bounds the steps from `start` to `end`, as seen at time `at`."""
    size = abs(motion.eigenvalue)
    return Remark(RemarkKind.STIFF, motion.joint, "v", start, end - start, at, size, None, str(motion), remedy)
