"""Faults planted in logs: `tests/campaigns/identify` judges many."""

from __future__ import annotations

import numpy as np
import pytest

from robot_dyn.tools.identify import identify
from tests.campaigns.identify.planted import FAULTS, arm_named, judge, planted, shifted


@pytest.mark.parametrize("fault", FAULTS)
def test_the_verdict_names_a_planted_fault(fault: str) -> None:
    """Of a log whose residual is at least three times the noise; a smaller one is not seen."""
    row = judge(3, fault)
    assert row.rank == 0 if row.ratio >= 3.0 else not row.first


def test_two_faults_are_not_one_cause() -> None:
    """A mass, and an offset of the first joint of a quarter of its torque: neither explains 90 %."""
    case = planted(3, "mass")
    tau = case.log["tau"] + 0.25 * np.eye(case.log["tau"].shape[1])[0] * case.log["tau"].std(axis=0)
    assert identify(arm_named(case.arm), case.log, effects=case.effects).verdict.has_single_cause
    assert not identify(arm_named(case.arm), case.log | {"tau": tau}, effects=case.effects).verdict.has_single_cause


def test_a_clean_log_raises_no_alarm() -> None:
    assert not judge(3, "").first


def test_a_planted_centre_of_mass_is_that_of_the_moved_link() -> None:
    """By the parallel-axis theorem: the moments about the centre do not change, which moves by 5 cm."""
    rng, m, c = np.random.default_rng(1), 2.0, np.array([0.1, -0.2, 0.3])
    inner = np.diag([0.02, 0.03, 0.04])

    def theta(c: np.ndarray) -> np.ndarray:
        about = inner + m * ((c @ c) * np.eye(3) - np.outer(c, c))
        return np.array([m, *(m * c), *about[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)]])

    moved = shifted(theta(c), rng)
    assert np.linalg.norm(moved[1:4] / m - c) == pytest.approx(0.05)
    assert np.allclose(moved, theta(moved[1:4] / m))
