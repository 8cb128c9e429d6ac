"""The size of a run is known before it starts: what would not fit is refused at once, with the remedy."""

from __future__ import annotations

import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from robot_dyn.simulation.setup.setup import check_record, samples, segments, steps
from tests.long import long

ARM = rd.Plant(rd.load("planar_2r"), [rd.effects.ExternalWrench("tip", [1.0] * 6, start_s=0.3, end_s=0.7)])
LAW = rd.control.PD(rd.control.hold([0.1, 0.2]), kp=3.0, kd=1.0, period_s=0.01)


@pytest.mark.parametrize("duration", [1e9, 1e18, 1e300])
@pytest.mark.parametrize("method", ["RK4", "GaussLegendre4", "Rodas5PFixed", "DOP853"])
@pytest.mark.parametrize(
    ("options", "remedy"),
    [
        ({}, "longer (step_s|record_every_s)"),
        ({"record_every_s": 0.01}, "longer (step_s|record_every_s)"),
        ({"controller": LAW}, "longer period_s of the controller"),
    ],
    ids=["every step", "every 10 ms", "ticks"],
)
def test_a_run_that_fits_no_memory_is_refused_before_it_starts(duration, method, options, remedy) -> None:
    """Some 1e11 numbers or ticks and more: an attempt to hold them would not return."""
    if method == "DOP853" and not options:
        return  # it keeps 1000 samples and chooses its steps
    if method == "DOP853" and "controller" not in options and duration > 1e13:
        remedy = "floats resolve"  # with no record either
    with pytest.raises(QueryError, match=f"{remedy}.*shorter duration_s"):
        rd.simulate(ARM, q0=[0.1, 0.2], duration_s=duration, method=method, **options)


@pytest.mark.parametrize("duration", [1e13, 1e154, 1e300, 1e308])
def test_a_run_that_ends_at_a_time_that_floats_do_not_tell_is_refused(duration: float) -> None:
    """A method that chooses its steps is bounded by no number of them; from 2^43 s floats lie 2 ms apart and more."""
    for run in (rd.simulate, rd.rollouts, rd.accuracy.work_precision):
        with pytest.raises(QueryError, match=r"ends at a time that floats resolve to .* use a shorter duration_s, "):
            run(ARM, [0.1, 0.2], duration_s=duration)


def test_a_batch_that_fits_no_memory_is_refused_before_it_starts() -> None:
    """1e9 samples of 2 joints take 30 GiB; the steps between samples take no memory."""
    with pytest.raises(QueryError, match=r"1e\+07 samples of 100 runs.*longer record_every_s.*fewer runs"):
        rd.rollouts(rd.Setup(ARM, duration_s=1e5, q0=[0.1, 0.2], record_every_s=0.01), [[0.1, 0.2]] * 100, method="RK4")


@pytest.mark.parametrize("period", [0.0, 0.0237, *long([0.01])])
@pytest.mark.parametrize("law", [None, LAW], ids=["free", "sampled"])
@pytest.mark.parametrize("method", ["RK4", "DOP853"])
def test_the_size_that_is_told_bounds_the_run(method, law, period: float) -> None:
    """Not below what the run has, and not above it by more than the four steps a segment that rounding may add."""
    setup = rd.Setup(
        ARM, [0.1, 0.2], duration_s=1.0, controller=law, method=method, record_every_s=period, estimate_error=False
    )
    run = rd.simulate(setup, engine="interpreted")
    many = segments(setup)
    assert len(setup.segments) <= many <= len(setup.segments) + 6
    assert len(run.t) <= samples(setup) <= len(run.t) + 4 * many + 3
    if method != "DOP853":
        assert run.statistics.steps <= steps(setup) <= run.statistics.steps + 4 * many


def test_what_fits_is_not_refused() -> None:
    """An hour of 1 kHz control with samples of 10 ms: 3.6e6 ticks, 3.6e5 samples."""
    law = rd.control.PD(rd.control.hold([0.1, 0.2]), kp=3.0, kd=1.0, period_s=0.001)
    setup = rd.Setup(ARM, [0.1, 0.2], duration_s=3600.0, controller=law, record_every_s=0.01)
    check_record(setup)
