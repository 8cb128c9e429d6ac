"""Figures of a page: the overview holds the run's data, sizes are those asked for, and text keeps its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.text import Text

from robot_dyn import plot, save_plot
from robot_dyn.foundations import QueryError
from robot_dyn.view import PLOTS
from tests.long import long
from tests.view.plotted import cart_pole, cells, headings, lines, many, stretched, ur5

MM = 25.4  # in an inch


@pytest.fixture(scope="module")
def run():
    return ur5()


def eight():
    """Eight joints with all that an overview may hold: a reference, torques, work of four sources, an estimate."""
    run = ur5()
    one = replace(many(run, 8), extremes=None)
    works = {f"source_{k}": np.sin(one.t + k) for k in range(4)}
    ledger = replace(run.ledger, kinetic=one.t, potential=np.cos(one.t), work=works)
    return replace(one, desired=one.q + 0.1, deviation=-0.1 + 0 * one.q, ledger=ledger, error=run.error)


def test_the_overview_is_the_runs(run) -> None:
    """A row for each joint, with q and q_d, v, u and q − q_d; then energy, work, residual and estimated error."""
    figure, n = plot(run), len(run.joint_names)
    columns = [figure.axes[k : 4 * n : 4] for k in range(4)]
    for column, values, symbol in zip(
        columns, (run.q, run.v, run.u, run.deviation), ("q", "v", "u", "q − q_d"), strict=True
    ):
        for axes, expected in zip(column, values.T, strict=True):
            np.testing.assert_array_equal(axes.lines[0].get_xydata(), np.column_stack([run.t, expected]))
            assert axes.get_ylabel().partition("[")[0].strip() == symbol
    for axes, expected in zip(columns[0], run.desired.T, strict=True):
        (desired,) = lines(axes, "desired")
        assert desired.is_dashed()
        np.testing.assert_array_equal(desired.get_ydata(), expected)
    assert [axes.get_title(loc="left") for axes in columns[0]] == list(run.joint_names)
    stores, work, residual, error = figure.axes[4 * n :]
    np.testing.assert_array_equal(lines(stores, "K")[0].get_ydata(), run.ledger.kinetic)
    np.testing.assert_array_equal(work.lines[0].get_ydata(), run.ledger.work["control"])
    assert residual.get_title(loc="left").startswith("Residual")
    np.testing.assert_array_equal(error.lines[0].get_xdata(), run.error.t)


def test_what_a_run_lacks_has_no_axes(run) -> None:
    """A swing without control, reference or estimate: q, v, the ledger. That u is 0 is said."""
    cart = replace(cart_pole(), error=None)
    figure = plot(cart)
    assert not cells(figure, "q − q_d") and not cells(figure, "u") and "u is 0 throughout" in headings(figure)
    assert not any("Estimated" in axes.get_title(loc="left") for axes in figure.axes)
    assert "u is 0" not in headings(plot(run))
    unknown = plot(replace(cart, u=np.full_like(cart.u, np.nan)))  # not recorded, which is not 0
    assert not cells(unknown, "u") and "u is 0" not in headings(unknown)


def test_a_frame_that_follows_has_its_own_row(run) -> None:
    figure = plot(replace(run, desired=None, deviation=run.deviation[:, :3]))
    titles = [axes.get_title(loc="left") for axes in cells(figure, "p − p_d")]
    assert titles == ["frame, x", "frame, y", "frame, z"]


@pytest.mark.parametrize("width", [80, 300, *long([120])])
def test_eight_joints_fit_a_page_of_a4_at_any_width(width: float) -> None:
    """Whatever is asked for, in [mm]; no text covers another, and all have 7 to 9 pt."""
    for name in PLOTS:
        figure = plot(eight(), name, width_mm=width)
        across, tall = figure.get_size_inches() * MM
        assert across == pytest.approx(width) and tall <= 297 + 1e-9, name
        figure.draw_without_rendering()
        texts = {text for text in figure.findobj(Text) if text.get_text() and text.get_visible()}
        assert {text.get_fontsize() for text in texts} <= {7.0, 7.5, 8.0, 9.0}
        numbers = {text for axes in figure.axes for text in (*axes.get_xticklabels(), *axes.get_yticklabels())}
        boxes = [axes.get_window_extent() for axes in figure.axes]
        boxes += [text.get_window_extent().padded(-1) for text in texts - numbers]
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i]), name
        page = figure.bbox.padded(1)
        assert all(page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 for box in boxes), name
        assert all(box.y1 <= page.y1 for box in boxes), name


def test_what_a_narrow_page_has_no_room_for_is_said(run) -> None:
    narrow = plot(run, width_mm=85)
    assert cells(narrow, "u") and not cells(narrow, "v") and "no room for error and v" in headings(narrow)
    assert "no room" not in headings(plot(run))


def test_parts_and_joints_are_named_alike(run) -> None:
    """Positions of names, `only`, one name as a text."""
    asked = [plot(run, "torques", joints="elbow_joint"), plot(run, only=("torques",), joints=("elbow_joint",))]
    for figure in (*asked, plot(run, only="torques", joints=["elbow_joint"])):
        (axes,) = figure.axes
        np.testing.assert_array_equal(axes.lines[0].get_ydata(), run.u[:, 2])
    overview = plot(run, joints=["wrist_3_joint", "elbow_joint"])
    assert [axes.get_title(loc="left") for axes in cells(overview, "q")] == ["elbow_joint", "wrist_3_joint"]


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"width_mm": 10}, "width_mm must be at least 80, got 10"),
        ({"width_mm": 2e3}, "width_mm must be at most 1000, got 2000"),
        ({"style": "papr"}, "no style 'papr'; nearest: paper"),
        ({"style": "paper", "theme": "dark"}, "leave theme='dark' out"),
        ({"only": "torque"}, "no plot 'torque'; nearest: torques"),
        ({"only": 3}, "only: give names of parts, got 3"),
        ({"joints": ["elbow"]}, "no joint 'elbow'; nearest: elbow_joint"),
    ],
)
def test_options_without_meaning_are_refused(run, options: dict, text: str) -> None:
    with pytest.raises(QueryError, match=text):
        plot(run, **options)


def test_a_paper_has_no_title_thin_lines_and_dashes_that_differ(run) -> None:
    """Curves on the same axes differ in their dashes, so that a grey print keeps them apart."""
    paper = plot(run, style="paper")
    assert not headings(paper).strip() and paper.get_facecolor()[:3] == (1, 1, 1)
    for axes in paper.axes:
        curves = [line for line in axes.lines if not line.get_label().startswith("_")]
        assert len({str(line._dash_pattern) for line in curves}) == len(curves)
        assert all(line.get_linewidth() <= 0.8 for line in axes.lines)
        assert max(to_rgb(curves[0].get_color())) < 0.6  # dark enough on white


@pytest.mark.parametrize(("suffix", "page"), [(".svg", b'width="340.157'), (".pdf", b"340.157")])
def test_vector_files_have_the_width(run, tmp_path, suffix: str, page: bytes) -> None:
    """120 mm are 340.157 pt; a PNG has them by its dots."""
    path = save_plot(run, tmp_path / f"run{suffix}", "torques", width_mm=120, style="paper")
    assert page in path.read_bytes() and b"<image" not in path.read_bytes()
    png = save_plot(run, tmp_path / "run.png", "torques", width_mm=127, dpi=100).read_bytes()
    assert int.from_bytes(png[16:20], "big") == 500


def test_many_remarks_leave_room_for_the_curves(run) -> None:
    """The last line says where the others are."""
    long = replace(run, outcome=replace(run.outcome, advice="take a smaller step, " * 90))
    figure = plot(long)
    assert figure.get_size_inches()[1] * MM <= 297 and "the summary has all remarks" in headings(figure)


def test_thirty_joints_have_a_row_each() -> None:
    figure = plot(replace(many(ur5(), 30), extremes=None))
    assert len(cells(figure, "q")) == 30
    assert all(axes.get_position().height * figure.get_size_inches()[1] * MM >= 8.4 for axes in figure.axes)


def test_a_long_run_is_an_overview_in_seconds(run) -> None:
    drawn = plot(stretched(run, 100_000)).axes[0].lines[0].get_ydata()
    assert len(drawn) < 5000
