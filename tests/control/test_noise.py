"""Noise: equal bits alone, in batches and in threads, interpreted and compiled; and its statistics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr, ndtri

import robot_dyn as rd
from robot_dyn.codegen import INSTEAD, MachineFunction
from robot_dyn.simulation.run.philox import draw, normal, philox

ARM = rd.Plant(rd.load("planar_2r").with_(gravity=(0.0, 0.0, 0.0)))
WEAK = 2.0**-100  # [N m/rad]: the arm moves by less than a unit of rounding of the noise
SEED, TICKS, PERIOD = 2**62 + 11, 25, 0.01
_draw = MachineFunction(draw, INSTEAD, lambda: None, "").calls()


def deviates(seed: int, run: int, ticks: int, channels: int) -> np.ndarray:
    """By the function of the loop, (ticks, channels)."""
    made, keys = np.zeros((channels, 1)), np.array([[seed], [run], [0]], dtype=np.uint64)
    rows = []
    for tick in range(ticks):
        _draw(made, 0, channels, keys, tick)
        rows.append(made[:, 0].copy())
    return np.array(rows)


@pytest.mark.parametrize("key", [(0, 0), (7, 11), (2**63 - 1, 2**64 - 1)])
def test_words_are_those_of_numpys_philox(key: tuple[int, int]) -> None:
    """Which counts one on before it draws."""
    for tick, block in ((1, 0), (5, 3), (2**63 + 5, 2**40)):
        counter = np.array([tick - 1, block, 0, 0], dtype=np.uint64)
        theirs = np.random.Philox(counter=counter, key=np.array(key, dtype=np.uint64)).random_raw(4)
        with np.errstate(over="ignore"):
            ours = philox(*map(np.uint64, (tick, block, *key)))
        assert [int(x) for x in ours] == theirs.tolist()


def test_deviates_are_the_inverse_of_the_normal_distribution() -> None:
    """To 1e-15 of themselves by AS 241, at middles of equal parts of (0, 1), the outermost among them."""
    words = np.random.default_rng(0).integers(0, 2**63, 4000, dtype=np.uint64)  # below ½, where p is exact in floats
    p = ((words >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
    inner = np.abs(p - 0.5) > 1e-3  # nearer to ½ SciPy's is rounded in p
    np.testing.assert_allclose([normal(x) for x in words[inner]], ndtri(p[inner]), rtol=4e-13)
    assert normal(np.uint64(0)) == pytest.approx(ndtri(2.0**-54), rel=1e-14)
    assert normal(np.uint64(2**64 - 1)) == -normal(np.uint64(0))


def test_machine_code_draws_the_same_bits() -> None:
    keys = np.array([[3, 3, 2**63], [0, 1, 9], [0, 5, 2**62]], dtype=np.uint64)
    one, two = np.zeros((9, 3)), np.zeros((9, 3))
    for tick in (0, 1, 1000, 2**40):
        with np.errstate(over="ignore"):
            draw(one, 1, 7, keys, tick)
        _draw(two, 1, 7, keys, tick)
        assert one.tobytes() == two.tobytes()
    assert not one[[0, 8]].any()
    assert len(np.unique(one[1:8])) == 21


def test_noise_is_the_same_alone_in_batches_and_in_threads() -> None:
    """Of a torque too weak to move the arm, u = kp (0 − q − ξ) = −kp ξ is the noise itself, bit by bit."""
    loop = rd.control.Loop(
        rd.control.PD(rd.control.hold([0.0, 0.0]), kp=WEAK, kd=0.0, period_s=PERIOD),
        position=rd.control.Noise(1.0),
        noise_seed=SEED,
    )
    given = {"duration_s": TICKS * PERIOD, "record_every_s": PERIOD}
    expected = [-WEAK * deviates(SEED, run, TICKS + 1, 2) for run in range(130)]
    for integrator in ("RK4", "DOP853"):
        for engine in ("interpreted", "compiled"):
            for run in (0, 77):
                each = replace(loop, run=run)
                options = given | {"method": integrator, "engine": engine, "estimate_error": False}
                made = rd.simulate(ARM, [0.0, 0.0], controller=each, **options)
                assert made.u.tobytes() == expected[run].tobytes(), (integrator, engine, run)
        for threads in (1, 2):
            options = given | {"method": integrator, "record": ("u",), "threads": threads}
            runs = rd.rollouts(ARM, np.zeros((130, 2)), controller=loop, **options)
            assert runs.u.tobytes() == np.array(expected).tobytes(), (integrator, threads)


def test_each_tick_has_its_noise_whatever_the_steps_and_the_delay() -> None:
    """A tick of several instants has one; a companion of other steps has the same, so that errors can be estimated."""
    loop = rd.control.Loop(
        rd.control.PD(rd.control.hold([0.0, 0.0]), kp=WEAK, kd=0.0, period_s=PERIOD), position=rd.control.Noise(1.0),
        measurement_delay_periods=0.3,
        actuation_delay_periods=1.5, noise_seed=4,
    )  # fmt: skip
    run = rd.simulate(
        ARM, [0.0, 0.0], controller=loop, method="RK4", step_s=1e-3, duration_s=0.1, record_every_s=PERIOD
    )
    np.testing.assert_array_equal(
        run.u[2:], -WEAK * deviates(4, 0, 11, 2)[:9]
    )  # at t_k that of t_{k−2}, which came at k − ½
    assert not run.u[:2].any()
    assert run.error.largest < 1e-12


def test_noise_makes_no_velocity_at_the_first_tick() -> None:
    """Before the start the arm was measured where it starts, with the noise of the first tick."""
    noise = {"position": rd.control.Noise(1e-3), "velocity": rd.control.Differences()}
    loop = rd.control.Loop(rd.control.PD(rd.control.hold([0.0, 0.0]), kp=0.0, kd=WEAK, period_s=PERIOD), **noise)  # type: ignore[arg-type]
    run = rd.simulate(ARM, [0.3, 0.2], controller=loop, duration_s=0.1, record_every_s=PERIOD, estimate_error=False)
    assert not run.u[0].any()
    expected = -WEAK * np.diff(0.2 + 1e-3 * deviates(0, 0, 11, 2)[:, 1]) / PERIOD
    np.testing.assert_allclose(run.u[1:, 1], expected, rtol=1e-9)


def test_deviates_are_normal_white_and_independent() -> None:
    """Each bound is passed by chance once in 1e6 or less: five standard deviations; 2 exp(−2 c²) of Kolmogorov's."""
    N = 40_000
    x = np.stack([deviates(5, 0, N, 5), deviates(5, 1, N, 5), deviates(6, 0, N, 5)], axis=1).reshape(N, -1)  # 15
    assert np.abs(x.mean(axis=0)).max() < 5 / np.sqrt(N)
    assert np.abs(x.var(axis=0) - 1).max() < 5 * np.sqrt(2 / N)
    assert np.abs((x**3).mean(axis=0)).max() < 5 * np.sqrt(15 / N)
    assert np.abs((x**4).mean(axis=0) - 3).max() < 5 * np.sqrt(96 / N)
    steps = np.arange(1, N + 1)[:, None] / N
    assert np.sqrt(N) * np.abs(ndtr(np.sort(x, axis=0)) - steps + 0.5 / N).max() < 2.7 + 0.5 / np.sqrt(N)
    for lag in (1, 2, 3, 4, 10, 64, 1000):  # of all channels, runs and seeds with all
        correlation = x[lag:].T @ x[:-lag] / N
        assert np.abs(correlation).max() < 5.5 / np.sqrt(N), lag  # the largest of 225
    together = x.T @ x / N - np.eye(15)
    assert np.abs(together[~np.eye(15, dtype=bool)]).max() < 5.5 / np.sqrt(N)
