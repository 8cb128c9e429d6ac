"""Detection of stiff runs: stability limits the steps of an explicit method that chooses them, h |λ| ≈ 6.

A stiff method is then faster. [Hairer, Wanner 1996, IV.2, p. 21]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.simulation.dynamics.fastest_motion import Fastest, fastest
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.run.outcome import Stiff
from robot_dyn.simulation.setup.setup import Setup

FIRST_LOOK = 500  # number of steps of a run at its first check; each later check doubles it
_BOUND = 4.0, 9.0  # h |λ| of explicit steps that stability limits: DOP853 oscillates about 6.1
_WORTH = 1000  # remaining steps that make a restart worthwhile
_MEAN = 20  # steps whose mean length is used


def changes_over(setup: Setup, equation: StateEquation, ends: Array, y: Array, held: Array | None) -> Stiff | None:
    """Return `Stiff` if stability limits the steps of a run and many steps remain, else None.

    Args:
        setup: The setup of the run.
        equation: The state equation at the time reached.
        ends: Ends of its steps so far, in [s].
        y: State at the last of them.
        held: Actuation in zero-order hold, or None.
    """
    t, h = float(ends[-1]), float(ends[-1] - ends[-1 - _MEAN]) / _MEAN
    if h * _WORTH > setup.duration_s - t:
        return None
    try:
        motion = fastest(equation, t, y, held)
    except (RobotDynError, np.linalg.LinAlgError):
        return None
    return Stiff(t, motion) if stability_limits(motion, h) else None


def stability_limits(motion: Fastest, h: float) -> bool:
    """Return True if stability limits explicit steps of length h."""
    return motion.decays and _BOUND[0] < abs(motion.eigenvalue) * h < _BOUND[1]
