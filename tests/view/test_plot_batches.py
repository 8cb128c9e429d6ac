"""Figures of a batch: quantiles are NumPy's, columns are those of its table, and no run that diverged is dropped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import plot
from robot_dyn.foundations import QueryError
from robot_dyn.view import PlotError
from robot_dyn.view.plots.batch import BATCH_PLOTS, LEVELS
from tests.view.plotted import cart_pole, headings, lines

COUNT, LOST = 40, [5, 9, 30]
ARM, Q = rd.load("planar_2r"), np.array([0.4, -0.7])


def batch(fast: float) -> rd.Rollouts:
    """Runs of other starts and gains; with `fast`, in [rad/s], three of them diverge."""
    reference = rd.control.quintic(Q, Q + 0.5, 0.1)
    controller = rd.control.PD(reference, kp=40.0, kd=[4.0, 3.0])
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction([0.3, 0.1])])
    setup = rd.Setup(plant, Q, duration_s=0.2, controller=controller, method="RK4", step_s=2e-3)
    q0 = Q + 0.3 * np.random.default_rng(3).normal(size=(COUNT, 2))
    v0 = np.full((COUNT, 2), 0.3)
    v0[LOST] = [0.01 * fast, fast] if fast else 0.3
    return rd.rollouts(setup, q0, v0, vary={"kp": np.linspace(20.0, 80.0, COUNT)})


@pytest.fixture(scope="module")
def runs() -> rd.Rollouts:
    return batch(0.0)


@pytest.fixture(scope="module")
def some_lost() -> rd.Rollouts:
    found = batch(3e7)
    assert np.flatnonzero(found.diverged).tolist() == LOST
    return found


def band(axes, label: str) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper edge of a band that fill_between drew: there and back along t."""
    (of,) = (each for each in axes.collections if each.get_label() == label)
    vertices = of.get_paths()[0].vertices
    m = (len(vertices) - 3) // 2
    return vertices[1 : m + 1, 1], vertices[m + 2 : -1, 1][::-1]


def test_bands_are_numpys_quantiles_of_the_runs_that_did_not_diverge(runs, some_lost) -> None:
    for each in (runs, some_lost):
        q = each.q[~each.diverged]
        for i, axes in enumerate(plot(each, "fan").axes):
            low, quarter, median, three, high = np.quantile(q[:, :, i], LEVELS, axis=0)
            np.testing.assert_array_equal(lines(axes, "median")[0].get_xydata(), np.column_stack([each.t, median]))
            np.testing.assert_array_equal(band(axes, "25 to 75 %"), (quarter, three))
            np.testing.assert_array_equal(band(axes, "5 to 95 %"), (low, high))


def test_the_fan_of_tracking_is_of_the_error_of_each_run(runs) -> None:
    off = np.array([run.tracking_error for run in runs])
    for i, axes in enumerate(plot(runs, "tracking").axes):
        drawn = lines(axes, "median")[0].get_ydata()
        np.testing.assert_allclose(drawn, np.median(off[:, :, i], axis=0), rtol=0, atol=1e-15)
        assert axes.get_ylabel() == "q_d − q [rad]"


def test_runs_that_diverged_are_drawn_and_counted_in_each_part(some_lost) -> None:
    """Lines with crosses in a fan, a bar of their own, crosses at the edge of a scatter; the scale is of the others."""
    figure = plot(some_lost, "fan")
    for i, axes in enumerate(figure.axes):
        (crosses,) = lines(axes, "diverged (3)")
        for line, run, end in zip(lines(axes, "_diverged"), LOST, crosses.get_xdata(), strict=True):
            np.testing.assert_array_equal(line.get_ydata(), some_lost.q[run, :, i])
            assert end == some_lost.t[np.isfinite(some_lost.q[run, :, i])][-1]
        assert np.abs(axes.get_ylim()).max() < 10
    assert "3 of 40 diverged" in headings(figure)
    (axes,) = plot(some_lost, "outcomes").axes
    assert all(tick == round(tick) for tick in axes.get_yticks())  # numbers of runs
    assert {
        label.get_text(): bar.get_height() for label, bar in zip(axes.get_xticklabels(), axes.patches, strict=True)
    } == {
        "finished": 37,
        "diverged": 3,
    }
    (axes,) = plot(some_lost, "histogram").axes
    heights = [bar.get_height() for bar in axes.patches]
    assert sum(heights[:-1]) == 37 and heights[-1] == 3
    assert "3 diverged" in [text.get_text() for text in axes.texts]
    (axes,) = plot(some_lost, "scatter").axes
    assert axes.get_title(loc="left") == "37 runs; 3 of 40 diverged"
    (crosses,) = lines(axes, "diverged (3)")
    np.testing.assert_array_equal(crosses.get_xdata(), some_lost.varied["kp"][LOST, 0])


def test_a_batch_of_which_all_diverged_is_drawn(some_lost, tmp_path) -> None:
    plot(some_lost[5:6], "fan", "outcomes", "scatter", x="start q joint_1").save(tmp_path / "lost.png", dpi=40)
    with pytest.raises(PlotError, match="every run diverged"):
        plot(some_lost[5:6], "histogram")


def test_columns_are_those_of_the_table_with_their_units(runs) -> None:
    """By default the tracking error over what was swept; others with or without their unit."""
    table = runs.table()
    (axes,) = plot(runs, "scatter").axes
    assert axes.get_xlabel() == "kp joint_1 [N m/rad]" and axes.get_ylabel().startswith("rms tracking error [")
    np.testing.assert_array_equal(
        axes.lines[0].get_xydata(), np.column_stack([runs.varied["kp"][:, 0], runs.rms_tracking_error])
    )
    (axes,) = plot(runs, "scatter", x="start q joint_2", y="largest v joint_1 [rad/s]").axes
    expected = np.column_stack([runs.q0[:, 1], table["largest v joint_1 [rad/s]"]])
    np.testing.assert_array_equal(axes.lines[0].get_xydata(), expected)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("start q joint_2 [rad]", "largest v joint_1 [rad/s]")
    (axes,) = plot(runs, "histogram", y="largest v joint_1").axes
    counts = np.histogram(table["largest v joint_1 [rad/s]"], bins=len(axes.patches))[0]
    assert [bar.get_height() for bar in axes.patches] == counts.tolist()


def test_all_parts_fit_a_page_and_are_named(some_lost, tmp_path) -> None:
    whole = plot(some_lost)
    assert whole.get_size_inches()[1] * 25.4 <= 297
    assert all(each in headings(whole) for each in ("Positions", "Tracking error", "Outcomes", "Histogram", " over "))
    for name in BATCH_PLOTS:
        for suffix in (".png", ".svg", ".pdf"):
            assert (
                plot(some_lost, name, joints="joint_2").save(tmp_path / f"{name}{suffix}", dpi=30).stat().st_size > 1000
            )


@pytest.mark.parametrize(
    ("names", "options", "text"),
    [
        (["fann"], {}, "no plot 'fann'; nearest: fan"),
        (["torques"], {}, "no plot 'torques'; nearest: outcomes"),
        (["fan"], {"joints": ["joint_3"]}, "no joint 'joint_3'; nearest: joint_"),
        (["scatter"], {"x": "kq joint_1"}, "x: no column 'kq joint_1'; nearest: kp joint_1"),
        (["scatter"], {"y": "outcome"}, "y: no column 'outcome'"),  # which is text
        (["scatter"], {"x": 3}, "x must name a column of the table of runs, got 3"),
        (["fan"], {"limits": [1.0, 1.0]}, "limits= applies to a single run"),
    ],
)
def test_names_that_are_not_there_are_refused(runs, names: list[str], options: dict, text: str) -> None:
    with pytest.raises(QueryError, match=text):
        plot(runs, *names, **options)
    with pytest.raises(QueryError, match="x and y are columns of rollouts"):
        plot(cart_pole(), x="t")


def test_what_was_not_recorded_is_refused_by_name_and_left_out_of_the_whole(runs) -> None:
    bare = replace(runs, q=None)
    for name in ("fan", "tracking"):
        with pytest.raises(PlotError, match="positions"):
            plot(bare, name)
    words = headings(plot(bare))
    assert "Outcomes" in words and "Positions" not in words
