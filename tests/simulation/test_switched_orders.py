"""Fixed steps over scenes that are smooth in pieces: each method keeps its order, by cuts of its own steps."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from tests.effects.test_effect_states import ARM

START = [0.3, -0.2]
ROUGH = rd.control.PiecewisePolynomial(  # its velocity jumps
    [0.0, 0.21, 0.53, 1.0],
    [[[0.3, -0.2], [1.0, 0.4]], [[0.51, -0.116], [-0.6, 1.2]], [[0.318, 0.268], [0.9, -0.7]]],
)
FRICTION = rd.effects.LuGreFriction([60.0, 40.0], [2.0, 1.0], [1.0, 0.5], [1.5, 0.8], [2.0, 1.0], 1.0)
PD = rd.control.PD(rd.control.quintic([0.1, 0.2], [0.9, -0.4], 0.5), kp=[150.0, 60.0], kd=[12.0, 5.0])
PUSH = rd.effects.ExternalWrench("tip", [30.0, -20.0, 0.0, 0.0, 0.0, 2.0], "world_aligned", 0.3137, 0.3149)
FAR, LIMIT = rd.control.quintic([0.1, 0.2], [1.3, -0.7], 0.8), [18.0, 5.0]
SCENES = {
    "break of the reference": ([], rd.control.PD(ROUGH, kp=[150.0, 60.0], kd=[12.0, 5.0])),
    "window shorter than a step": ([PUSH], PD),
    "stops struck": (rd.effects.joint_stops([-1.2, -0.9], [0.35, 0.8], 2e3, 20.0), None),
    "bristles that reverse": ([FRICTION], PD),
    "limits reached and left": (
        [rd.effects.EffortLimit(LIMIT)],
        rd.control.ComputedTorque(ARM, FAR, kp=144.0, kd=24.0),
    ),
    "limits, with back-calculation": (
        [],
        rd.control.PID(FAR, kp=[120.0, 60.0], ki=[300.0, 150.0], kd=[20.0, 8.0], effort_limit=LIMIT),
    ),
}
LIMITED = {"limits reached and left": 7, "limits, with back-calculation": 3}  # events


def run(scene: str, **options) -> rd.Trajectory:
    effects, controller = SCENES[scene]
    options = {"estimate_error": False, "record_every_s": 0.9, "engine": "compiled"} | options
    return rd.simulate(rd.Plant(ARM, effects), START, duration_s=0.9, controller=controller, **options)


@pytest.mark.parametrize("scene", SCENES)
def test_halved_steps_keep_the_order(scene: str) -> None:
    """The same events, and in the mean of five halvings order 4 ± 0.15; order 8 down to 7.5, or to rounding."""
    exact = run(scene, method=rd.integrate.Adaptive("DOP853", 1e-13, 1e-13))
    names = [each.name for each in exact.events]
    assert (len(names) > 1) is (scene in ("stops struck", "bristles that reverse", *LIMITED))
    assert len(names) == LIMITED.get(scene, len(names))
    errors = []
    for h in 5e-3 / 2 ** np.arange(6):
        made = run(scene, method="RK4", step_s=h)
        assert [each.name for each in made.events] == names
        errors.append(np.abs(made.q[-1] - exact.q[-1]).max())
    assert -np.polyfit(np.arange(6), np.log2(errors), 1)[0] == pytest.approx(4, abs=0.15)
    steps, floor = ((0.02, 0.01), 0.0) if scene in LIMITED else ((0.005, 0.0025), 1e-13)
    coarse, fine = (np.abs(run(scene, method="DP8", step_s=h).q - exact.q).max() for h in steps)
    assert fine < max(coarse / 2**7.5, floor)
    for tolerance in (1e-6, 1e-9) if scene in LIMITED else ():
        loose = run(scene, method=rd.integrate.Adaptive(rtol=tolerance, atol=tolerance))
        assert np.abs(loose.q[-1] - exact.q[-1]).max() < tolerance


def test_bristles_at_rest_reverse_no_more() -> None:
    """Where a joint comes to rest its velocity is rounding, to and fro: below a millionth of v_s nothing is cut."""
    effects, controller = SCENES["bristles that reverse"]
    still = rd.simulate(
        rd.Plant(ARM, effects), START, duration_s=20.0, controller=controller, engine="compiled", record_every_s=20.0,
        method=rd.integrate.Adaptive("DOP853", 1e-10, 1e-10), estimate_error=False,
    )  # fmt: skip
    assert 2 < len(still.events) < 100
    assert still.events[-1].t < 10.0
    assert not any("chatters" in each.name for each in still.events)


def test_companions_of_a_run_that_an_event_ends_go_on_past_it() -> None:
    """The event falls on times at which runs are compared, ± 3e-8 s: a companion may meet it before, the run behind."""
    options = {"duration_s": 2.0, "method": rd.integrate.Adaptive("DOP853", 1e-6, 1e-6), "record_every_s": 0.1}
    free = rd.simulate(ARM, START, estimate_error=False, **options)
    for k in range(2, 10):
        way = np.sign(free.v[k, 0])
        angle = free.q[k, 0] + 1e-11 * way
        end = rd.Event(lambda t, q, v, angle=angle: q[0] - angle, direction=int(way), terminal=True, name="there")
        made = rd.simulate(ARM, START, events=[end], **options)
        assert made.outcome.t == pytest.approx(free.t[k], abs=1e-7)
        assert made.error is not None
        assert made.error.note == ""
