"""Problems A01 and A05 of the IFToMM library of multibody benchmarks, against a closed form and equations by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.iftomm import PROBLEMS, governor, pendulum

import robot_dyn as rd

A01, A05 = PROBLEMS.values()


def test_the_simple_pendulum_moves_as_its_elliptic_functions() -> None:
    """10 s in 1000 steps of order 8, whose error is rounding: 1e-12 m."""
    run = rd.simulate(A01.setup(estimate_error=False))
    assert len(run.t) == 1001
    assert np.abs(A01.position(run.q) - pendulum(run.t)).max() < 1e-12
    assert np.ptp(run.q) > 3.1


def test_the_flyball_governor_moves_as_equations_by_hand() -> None:
    """0.4 s, in which the slider falls and its couplers lose their motion; Radau at 1e-11 leaves some 1e-11 m."""
    run = rd.simulate(A05.setup(estimate_error=False, duration_s=0.4))
    reference = governor(run.t[[0, -1]], "Radau", 1e-11)
    assert A05.position(run.q)[-1, 0] - reference[-1, 0] == pytest.approx(0, abs=1e-10)
    assert np.ptp(run.q[:, 3]) > 0.01
    np.testing.assert_allclose(run.q[:, 1], run.q[:, 2], atol=1e-12)


def test_the_governors_couplers_are_at_rest_length_and_its_ledger_closes() -> None:
    """By energy: what the dampers take is what is lost of K and of the potentials, 1e-12 of what is exchanged."""
    run = rd.simulate(replace(A05.setup(estimate_error=False), duration_s=0.4))
    start = A05.setup().plant.torque(np.zeros(4), np.zeros(4), t=0.0)
    np.testing.assert_allclose(start, 0.0, atol=1e-9)  # 8e5 N/m · 1e-16 m
    assert set(run.ledger.work) == {"control", "line_spring_damper", "line_spring_damper 2"}
    assert run.ledger.work["line_spring_damper"][-1] < -1e-3
    assert run.ledger.closure < 1e-11
