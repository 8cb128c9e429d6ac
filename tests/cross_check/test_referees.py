"""M, C v + N and forward dynamics of the whole catalog against engines that share no line with either implementation.

Their readers, kinematics and algorithms are their own: MuJoCo's, and Drake's where it is installed. What they refuse,
drop or change, the doctor of files names.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.accuracy import PeerError
from robot_dyn.lagrange import diagonal_scale, floored, magnitudes, mass_norm, scaled, solved_tolerance
from tests.campaigns.hard.other_engines import installed
from tests.long import robots

TOLERANCE = 1e-12  # of the terms added; MuJoCo's minimum of diagonals and Pinocchio's rounding leave 1e-13
REFUSED = {"inertia_impossible", "mass_missing", "inertia_missing", "inertia_zero"}  # by MuJoCo, which asks for bodies
CHANGED = {  # both drop moments without mass; Drake puts those of no body right
    "MuJoCo": {"inertia_without_mass"},
    "Drake": {"inertia_without_mass", "inertia_impossible"},
}
ENGINES = [each for each in installed() if each[0].split()[0] in CHANGED]


def loaded(name: str) -> rd.Robot:
    try:
        robot = rd.load(name)
    except RobotDynError as error:
        pytest.skip(f"is refused: {error}")
    return robot


def differences(robot: rd.Robot, other: Any) -> float:
    """The largest of M, inverse and forward dynamics at three states, over what is allowed."""
    own, rng, n, worst = rd.Lagrangian(robot), np.random.default_rng(11), robot.n, 0.0
    for _ in range(3):
        q, (v, tau) = robot.random_configuration(rng), rng.normal(size=(2, n))
        terms = magnitudes(own.linkage, q).inverse_dynamics(np.abs(v), np.zeros(n))
        ours = robot.M(q)
        bias = robot.inverse_dynamics(q, v, np.zeros(n)) - other.inverse_dynamics(q, v, np.zeros(n))
        worst = max(worst, scaled(ours - other.M(q), floored(diagonal_scale(ours))).max() / TOLERANCE)
        worst = max(worst, scaled(bias, floored(terms)).max() / TOLERANCE)
        if robot.joint_without_inertia is None and np.linalg.eigvalsh(ours)[0] > 0:
            apart = mass_norm(ours, robot.forward_dynamics(q, v, tau) - other.forward_dynamics(q, v, tau))
            size = float(np.linalg.norm((np.abs(tau) + terms) / np.sqrt(np.diag(ours))))
            worst = max(worst, float(apart) / (solved_tolerance(TOLERANCE, ours) * size))
    return float(worst)


def findings(name: str) -> set[str]:
    """The kinds of findings in a file: seconds where it has large meshes."""
    return {str(finding.kind) for finding in rd.tools.doctor.check_urdf(name).findings}


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
@pytest.mark.parametrize("name", robots())
@pytest.mark.parametrize(("program", "engine"), ENGINES, ids=[each[0].split()[0] for each in ENGINES])
def test_another_engine_has_the_same_equations(program: str, engine: Callable[[rd.Robot], Any], name: str) -> None:
    robot = loaded(name)
    if not robot.couplings.trivial:
        pytest.skip("has joints that follow others, which other engines keep as constraints")
    try:
        other = engine(robot)
    except PeerError as error:
        assert findings(name) & REFUSED, error
        return
    if differences(robot, other) > 1:
        assert findings(name) & CHANGED[program.split()[0]]
