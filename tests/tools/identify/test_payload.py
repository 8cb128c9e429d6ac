"""Laws of the load of an arm: intervals hold the truth, the nearest body is possible, blind is blind."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.description import parameters
from robot_dyn.foundations import spatial_inertia
from robot_dyn.tools.identify import LogError, PayloadEstimate, payload
from tests.tools.identify.followed import Bench, log_of

ARM = rd.load("ur5")
LINK = "tool0"
LOAD = rd.Payload(LINK, 1.8, (0.02, -0.03, 0.08), ((9e-3, 1e-3, 0.0), (1e-3, 8e-3, -1e-3), (0.0, -1e-3, 6e-3)))
TRUTH = parameters(spatial_inertia(LOAD.mass, np.array(LOAD.com), np.array(LOAD.inertia)))
BENCH = Bench(np.array([9.0, 8.0, 6.0, 2.0, 2.0, 1.0]), np.array([5.0, 5.0, 4.0, 1.5, 1.5, 1.0]))
OFFSET = np.array([0.3, -0.4, 0.2, 0.1, 0.0, -0.1])


@cache
def estimate(seed: int, stated: bool = True) -> PayloadEstimate:
    """The load on the arm of the file, or on another one that is measured without load too."""
    true = ARM if stated else ARM.with_(mass_scales={"forearm_link": 1.3, "upper_arm_link": 0.8})
    loaded = log_of(true.with_(payload=LOAD), BENCH, seed, OFFSET)
    return payload(ARM, loaded, empty=None if stated else log_of(true, BENCH, 100 + seed, -OFFSET), link=LINK)


@pytest.mark.parametrize("stated", [True, False])
def test_intervals_hold_the_load(stated: bool) -> None:
    """At least 25 of 30 of 3 logs: if independent, fewer have a probability of 0.2 % at 95 % each."""
    results = [estimate(seed, stated) for seed in range(3)]
    inside = [np.abs(result.values - TRUTH) <= result.half_widths for result in results]
    assert np.sum(inside) >= 25
    assert all(result.half_widths[0] < 0.1 * LOAD.mass for result in results)


def test_the_nearest_body_is_possible_and_near() -> None:
    """The load of the result can be carried: an impossible one raises an error. Its mass is within 5 %."""
    result = estimate(0)
    carried = ARM.with_(payload=result.load)
    assert carried.total_mass == pytest.approx(ARM.total_mass + result.load.mass)
    assert result.load.mass == pytest.approx(LOAD.mass, rel=0.05)
    I1, I2, I3 = np.linalg.eigvalsh(np.array(result.load.inertia))
    assert min(I1, I1 + I2 - I3) >= -1e-9


def test_no_load_is_found_on_an_empty_hand() -> None:
    """Zero is inside the intervals of an arm that carries nothing, except for 1 of 10 at most at 95 % each."""
    result = payload(ARM, log_of(ARM, BENCH, 7, OFFSET), link=LINK)
    assert np.sum(np.abs(result.values) > result.half_widths) <= 1
    assert result.load.mass >= 0


def test_what_no_torque_shows_has_no_number() -> None:
    """On a planar arm that turns about y, only m, m cx, m cz and Iyy turn a joint; the others are named."""
    arm = rd.load("planar_2r")
    true = arm.with_(payload=rd.Payload("tip", 0.7, (0.1, 0.2, 0.05)))
    bench = Bench(np.full(2, 0.5), np.full(2, 0.3))
    result = payload(arm, log_of(true, bench, 3), link="tip")
    assert {"m cy", "Ixx", "Ixy", "Ixz", "Iyz", "Izz"} == set(result.blind)
    assert np.isnan(result.values[[2, 4, 5, 7, 8, 9]]).all()
    assert result.load.mass > 0


def test_impossible_requests_raise_errors() -> None:
    log = log_of(ARM, BENCH, 7)
    for arguments in ({"link": "hand"}, {"link": "base_link"}, {"cutoff_hz": -1.0}, {"empty": {}}):
        with pytest.raises(rd.RobotDynError):
            payload(ARM, log, **arguments)
    with pytest.raises(LogError):
        payload(ARM, {key: x for key, x in log.items() if key != "tau"})
