"""Plots: axes hold what the run holds, with names and units; of odd, long or many-jointed runs too, and in files.

Sizes are those asked for, and text keeps its own.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from time import perf_counter

import numpy as np
import pytest
from matplotlib import rcParams
from matplotlib.colors import to_rgb
from matplotlib.text import Text

import robot_dyn as rd
from robot_dyn import plot
from robot_dyn.foundations import QueryError
from robot_dyn.simulation import Doubt, DoubtKind, Ledger, Outcome, Reason
from robot_dyn.view import PLOTS, PlotError
from robot_dyn.view.plots.plots import MAX_JOINTS
from tests.long import long, stress
from tests.view.plotted import cart_pole, cells, headings, legend, lines, many, stretched, ur5

MM = 25.4  # in an inch


@pytest.fixture(scope="module")
def run():
    return ur5()


@pytest.fixture(scope="module")
def cart():
    return cart_pole()


def test_positions_and_velocities_are_the_runs_and_desired_ones_dashed(run, cart) -> None:
    figure = plot(run, "joints")
    for symbol, label, values in (("q", "actual", run.q), ("v", "actual", run.v), ("q", "desired", run.desired)):
        for axes, column in zip(cells(figure, symbol), values.T, strict=True):
            (line,) = lines(axes, label)
            assert line.is_dashed() is (label == "desired")
            np.testing.assert_array_equal(line.get_xydata(), np.column_stack([run.t, column]))
    assert [axes.get_title(loc="left") for axes in cells(figure, "q")] == list(run.joint_names)
    assert not any(lines(axes, "desired") for axes in plot(cart, "joints").axes)


def test_tracking_plots_the_tracking_error_with_its_rms(run, cart) -> None:
    """Of joints, or of a frame, which the overview has, too."""
    figure = plot(run, "tracking")
    for axes, column in zip(figure.axes, run.tracking_error.T, strict=True):
        np.testing.assert_array_equal(axes.lines[0].get_ydata(), column)
    assert f"rms {run.rms_tracking_error:.2e} rad" in headings(figure)
    for names in ((), ("tracking",)):
        frame = cells(plot(replace(run, desired=None, tracking_error=run.tracking_error[:, :3]), *names), "p_d − p")
        assert [axes.get_title(loc="left") for axes in frame] == ["frame, x", "frame, y", "frame, z"]
        assert {axes.get_ylabel() for axes in frame} == {"p_d − p [m]"}
    with pytest.raises(PlotError, match="no reference"):
        plot(cart, "tracking")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"only": "torque"}, "no plot 'torque'; nearest: torques"),
        ({"only": "x"}, "known: overview, joints, torques"),
        ({"only": "elbow_joint"}, r"no plot 'elbow_joint'; it is a joint: give joints=\['elbow_joint'\]"),
        ({"only": 3}, "only: give names of parts, got 3"),
        ({"joints": ["elbow"]}, "no joint 'elbow'; nearest: elbow_joint"),
        ({"theme": "blue"}, "no theme"),
        ({"style": "papr"}, "no style 'papr'; nearest: paper"),
        ({"style": "paper", "theme": "dark"}, "omit theme='dark'"),
        ({"limits": np.ones(2)}, r"limits must have shape \(6,\) or .*, got \(2,\)"),
        ({"width_mm": 10}, "width_mm must be at least 80, got 10"),
        ({"width_mm": 2e3}, "width_mm must be at most 1000, got 2000"),
    ],
)
def test_options_without_meaning_are_refused(run, options: dict, text: str) -> None:
    with pytest.raises(QueryError, match=text):
        plot(run, **options)


@pytest.mark.parametrize("names", [*long([[]]), *stress([["joints"]])], ids=["overview", "joints"])
def test_thirty_joints_keep_their_names_and_do_not_overlap(run, names: list[str]) -> None:
    """In the overview each has a row of 8.4 mm or more."""
    figure = plot(replace(many(run, 30), extremes=None), *names)
    figure.draw_without_rendering()
    assert [axes.get_title(loc="left") for axes in cells(figure, "q")] == [f"joint_{i:02d}" for i in range(30)]
    boxes, page = [axes.get_window_extent() for axes in figure.axes], figure.bbox
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    assert all(page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1 for box in boxes)
    assert names or all(box.height / figure.dpi * MM >= 8.4 for box in boxes)


def test_more_joints_than_a_figure_has_room_for_are_refused(run) -> None:
    with pytest.raises(PlotError, match=f"1 to {MAX_JOINTS}; select some"):
        plot(many(run, MAX_JOINTS + 1), "joints")


@pytest.mark.parametrize(
    ("name", "width"),
    [("overview", 80.0), ("phase", 180.0), *long([("energy", 80.0), ("overview", 180.0)])],
)
def test_numbers_of_an_axis_do_not_overlap(run, name: str, width: float) -> None:
    """Two numbers or more on each axis that has any; small values are written as 5e−4 and need more room."""
    small = replace(run, q=run.q * 1e-3, v=run.v * 1e-3)
    for figure in (plot(run, name, width_mm=width), plot(small, name, width_mm=width)):
        figure.draw_without_rendering()
        for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
            low, high = sorted(axis.get_view_interval())
            shown = [
                tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high and tick.label1.get_visible()
            ]
            boxes = [tick.label1.get_window_extent() for tick in shown]
            assert not any(a.overlaps(b) for a, b in pairwise(boxes))
            assert len(boxes) > 1 or not boxes


def test_a_legend_names_curves_of_its_own_panel_only(run) -> None:
    (part,) = plot(run, "energy").subfigs[0].subfigs
    assert not part.legends
    for axes in part.axes:
        entries = [text.get_text() for text in shown.texts] if (shown := axes.get_legend()) else []
        assert entries == ([line.get_label() for line in axes.lines] if len(axes.lines) > 1 else [])


def test_names_of_y_axes_in_a_column_are_aligned(run) -> None:
    figure = plot(run)
    figure.draw_without_rendering()
    for symbol in ("q", "v", "u"):
        assert np.ptp([axes.yaxis.label.get_window_extent().x1 for axes in cells(figure, symbol)]) < 1


def test_units_are_those_of_each_joint(run, cart) -> None:
    """The URDF in the run tells which joint slides; a run without one leaves it open."""
    figure = plot(cart, "joints", "torques", "phase")
    assert [axes.get_ylabel() for axes in cells(figure, "q")] == ["q [m]", "q [rad]"]
    assert [axes.get_ylabel() for axes in cells(figure, "u")] == ["u [N]", "u [N m]"]
    assert {axes.get_xlabel() for axes in cells(figure, "v")} >= {"t [s]", "q [m]", "q [rad]"}
    assert "q [rad or m]" in {axes.get_ylabel() for axes in plot(replace(cart, metadata={})).axes}


def test_every_axis_has_a_unit(run) -> None:
    for axes in plot(run, *PLOTS).axes:
        assert "[" in axes.get_ylabel()
        shares = not axes.get_xlabel()  # the axis below has the numbers and the unit
        assert shares or "[" in axes.get_xlabel()


def test_limits_are_drawn_at_plus_and_minus_the_limit(run) -> None:
    limits = np.array([50.0, 60.0, np.inf, 20.0, 0.0, np.nan])  # 0 and nan: none is known
    for axes, limit in zip(cells(plot(run, "torques", limits=limits), "u"), limits, strict=True):
        levels = [line.get_ydata()[0] for line in lines(axes, "_limit")]
        assert levels == ([-limit, limit] if 0 < limit < np.inf else [])
        assert all(line.is_dashed() for line in lines(axes, "_limit"))


def test_limits_are_the_urdfs_unless_given(run) -> None:
    drawn = [lines(axes, "_limit")[1].get_ydata()[0] for axes in cells(plot(run, "torques"), "u")]
    np.testing.assert_array_equal(drawn, rd.load("ur5").effort_limit)


@pytest.mark.parametrize("by", ["plant", "controller", "both"])
def test_the_effort_limit_that_acts_is_shown_rather_than_that_of_the_file(by: str) -> None:
    """In figures, and in the curves and causes of the page; a joint without one keeps that of the file."""
    arm, q = rd.load("ur5"), np.array([0.1, -1.2, 1.8, -2.2, -1.5, 0.3])
    acting = np.array([15.0, np.inf, 10.0, np.inf, np.inf, np.inf])
    kp, kd = rd.control.gains_from(np.diag(arm.M(q)), 20.0)
    target = rd.control.hold(q + 0.1)
    limited = rd.control.PID(
        target, kp=kp, ki=kd, kd=kp, effort_limit=acting if by == "controller" else np.minimum(acting, 12.0)
    )
    controller = rd.control.PD(target, kp=kp, kd=kd) if by == "plant" else limited
    effects = [] if by == "controller" else [rd.effects.EffortLimit(acting)]
    short = rd.simulate(rd.Plant(arm, effects), q0=q, duration_s=0.05, controller=controller)
    smaller = np.minimum(acting, 12.0) if by == "both" else acting
    expected = np.where(np.isfinite(smaller), smaller, arm.effort_limit)
    drawn = [lines(axes, "_limit")[1].get_ydata()[0] for axes in cells(plot(short, "torques"), "u")]
    np.testing.assert_array_equal(drawn, expected)
    document = rd.replay(short).document
    assert [joint["limit"] for joint in document["causes"]["joints"]] == list(expected)
    assert {each["value"] for each in document["plots"][2]["limits"]} <= {*expected, *-expected}


def test_a_far_limit_does_not_flatten_the_torque(run) -> None:
    """Peak / limit decides: near limits are in sight, of far ones the title tells the part used."""
    peak = np.abs(run.u).max(axis=0)
    near, far = (cells(plot(run, "torques", limits=factor * peak), "u") for factor in (2.0, 100.0))
    for axes, limit in zip(near, 2 * peak, strict=True):
        assert axes.get_ylim()[0] < -limit and limit < axes.get_ylim()[1]
        assert axes.get_title(loc="left").endswith("50% of the limit")
    assert all(axes.get_ylim()[1] < 10 * top for axes, top in zip(far, peak, strict=True))


def test_the_energy_ledger_is_the_runs(cart) -> None:
    stores, work, residual = plot(cart, "energy").axes
    ledger = cart.ledger
    np.testing.assert_array_equal(lines(stores, "K")[0].get_ydata(), ledger.kinetic)
    np.testing.assert_array_equal(lines(stores, "E − E(0)")[0].get_ydata(), ledger.energy - ledger.energy[0])
    for name, values in ledger.work.items():
        np.testing.assert_array_equal(lines(work, f"W {name}")[0].get_ydata(), values)
    assert residual.get_yscale() == "log"
    drawn = residual.lines[0].get_ydata()
    np.testing.assert_array_equal(drawn[drawn > 0], np.abs(ledger.residual)[ledger.residual != 0])


def test_phase_is_velocity_over_position(cart) -> None:
    for i, axes in enumerate(plot(cart, "phase").axes):
        path = np.column_stack([cart.q[:, i], cart.v[:, i]])
        np.testing.assert_array_equal(lines(axes, "path")[0].get_xydata(), path)


def test_a_long_phase_portrait_keeps_its_shape(run) -> None:
    """25 turns of a circle, of 4000 samples each: no line between two that are drawn cuts a corner."""
    phase = 2 * np.pi * 5 * np.linspace(0.0, 5.0, 100_001)[:, None] * np.ones(len(run.joint_names))
    for axes in plot(stretched(run, 100_001, q=np.cos(phase), v=np.sin(phase)), "phase").axes:
        path = lines(axes, "path")[0].get_xydata()
        assert np.linalg.norm((path[1:] + path[:-1]) / 2, axis=1).min() > 1 - 1e-5  # half a step of 1/1000, squared


def test_small_numbers_at_logarithmic_axes_are_powers_with_few_digits(run) -> None:
    error = replace(run.error, error=np.logspace(-9, 0, len(run.error.t)))
    (axes,) = plot(replace(run, error=error), "error_growth").axes
    assert axes.get_ylim()[1] >= 1
    label = axes.yaxis.get_major_formatter()
    assert [label(x) for x in (1e-9, 1e-7, 1e-4, 1.0)] == ["1e−9", "1e−7", "0.0001", "1"]
    assert [label(x) for x in (3.0000000000000003e-5, -2e-5)] == ["3e−5", "−2e−5"]  # without a point alone


def test_error_growth_is_veiled_where_it_is_not_resolved(run) -> None:
    error = replace(run.error, until_s=0.1, ends_early=Doubt(DoubtKind.COMPANIONS_DIFFER))
    (axes,) = plot(replace(run, error=error), "error_growth").axes
    (veil,) = axes.patches
    assert veil.get_x() == pytest.approx(0.1) and axes.get_yscale() == "log"
    np.testing.assert_array_equal(axes.lines[0].get_xdata(), error.t)
    assert not plot(replace(run, error=replace(error, until_s=0.3)), "error_growth").axes[0].patches
    with pytest.raises(PlotError, match="no estimate"):
        plot(replace(run, error=None), "error_growth")


def test_names_are_drawn_letter_by_letter(run, tmp_path) -> None:
    """No mathematics, no hidden labels, no letters that the font lacks; a long name keeps both its ends."""
    names = (r"$\frac", "_first", "a_b^{c$x$", "関節", "arm_" + "x" * 200 + "_end", "per%cent #1")
    sources = {r"_$\sum$": run.ledger.kinetic, "control": run.ledger.kinetic}
    hostile = replace(run, joint_names=names, ledger=replace(run.ledger, work=sources), metadata={})
    plot(hostile).save(tmp_path / "names.png", dpi=40)  # warnings are errors
    titles = [axes.get_title(loc="left") for axes in cells(plot(hostile, "joints"), "q")]
    assert titles[:3] == list(names[:3]) and titles[3] in ("関節", r"\u95a2\u7bc0") and titles[5] == names[5]
    long_name = titles[4].replace("\n", "")
    assert long_name.startswith("arm_x") and long_name.endswith("x_end") and "…" in long_name
    assert r"W _$\sum$" in legend(plot(hostile, "energy"))


@pytest.mark.parametrize(
    "suffix, opening", [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".PDF", b"%PDF"), ("", b"\x89PNG")]
)
def test_the_suffix_says_the_format(cart, tmp_path, suffix: str, opening: bytes) -> None:
    path = plot(cart, "joints", theme="dark").save(tmp_path / f"plot{suffix}", dpi=40)
    assert path.read_bytes().startswith(opening) and path.suffix == (suffix or ".png")


def test_targets_that_cannot_be_written_are_refused(cart, tmp_path) -> None:
    with pytest.raises(PlotError, match=r"'.jpeg' is not a suffix for a plot; .*\.png, \.svg, \.pdf"):
        plot(cart).save(tmp_path / "plot.jpeg")
    with pytest.raises(PlotError, match="is a folder"):
        plot(cart).save(tmp_path)
    with pytest.raises(PlotError, match="there is no folder"):
        plot(cart, "joints").save(tmp_path / "no folder" / "plot.png", dpi=40)
    with pytest.raises(PlotError, match="cannot be drawn at 50000 dpi"):
        plot(cart, "joints").save(tmp_path / "plot.png", dpi=50_000)


@pytest.mark.parametrize("size", [1e308, 5e-324])
def test_numbers_at_the_ends_of_floats_are_drawn_as_far_as_an_axis_reaches(cart, size: float) -> None:
    """Of a run file that says that the run did not diverge; without a warning of NumPy's or Matplotlib's."""
    sides = size * (-1.0) ** np.arange(len(cart.t))
    ledger = replace(cart.ledger, kinetic=sides, work=dict.fromkeys(cart.ledger.work, -sides))
    strange = replace(cart, q=np.full_like(cart.q, size), ledger=ledger)
    assert isinstance(strange.summary, str)
    plot(strange).canvas.draw()


def test_a_run_without_samples_is_refused(cart) -> None:
    with pytest.raises(PlotError, match="no samples"):
        plot(replace(cart, t=cart.t[:0]))


def test_a_run_of_one_sample_is_a_point(cart, tmp_path) -> None:
    one = stretched(cart, 1)
    plot(one).save(tmp_path / "one.png", dpi=40)
    assert {line.get_marker() for axes in cells(plot(one, "joints"), "q") for line in axes.lines} == {"o"}


def test_a_diverged_run_shows_how_it_began_and_how_it_ended(cart, tmp_path) -> None:
    """What is not finite is left out, and the scale has room for 0.1 and 1e200."""
    growth = np.exp(np.linspace(0, 460, 200))[:, None] * [0.1, -0.1]
    growth[-3:] = [[np.nan], [np.inf], [np.nan]]
    energy = Ledger(growth[:, 0], growth[:, 1], {"control": growth[:, 0]})
    end = Outcome(Reason.STATE_OVERFLOWS, 5.0)
    fast = {"q": growth, "v": growth, "u": growth, "ledger": energy, "outcome": end}
    run = stretched(cart, 200, **fast, tracking_error=growth, desired=growth)
    plot(run).save(tmp_path / "diverged.png", dpi=40)
    figure = plot(run)
    assert all(np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all() for axes in figure.axes)
    assert {axes.get_yscale() for axes in cells(figure, "q")} == {"symlog"}
    assert end.text in headings(figure)
    nothing = np.full((200, 2), np.nan)
    plot(stretched(run, 200, q=nothing, v=nothing, u=nothing)).save(tmp_path / "nan.png", dpi=40)


def test_a_long_run_is_thinned_and_keeps_its_peaks(run) -> None:
    """Of 300 000 samples one is a peak, one a trough; all joints are drawn in seconds."""
    long = stretched(run, 300_000)
    u = long.u.copy()
    u[123_457], u[222_223] = 50.0, -70.0
    began = perf_counter()
    figure = plot(replace(long, u=u))
    assert perf_counter() - began < 10
    for axes in cells(figure, "u"):
        drawn = axes.lines[0].get_ydata()
        assert len(drawn) < 5000 and (drawn.min(), drawn.max()) == (-70.0, 50.0)
        assert axes.lines[0].get_xdata()[[0, -1]].tolist() == [0.0, 5.0]


def test_themes_differ_in_paper_and_nothing_global_is_set(cart) -> None:
    before = dict(rcParams)
    light, dark = (plot(cart, theme=theme) for theme in ("light", "dark"))
    assert sum(light.get_facecolor()[:3]) > 2.5 and sum(dark.get_facecolor()[:3]) < 0.5
    dark.draw_without_rendering()
    for axes in dark.axes:
        texts = [axes.yaxis.label, axes.title, *axes.get_yticklabels(), *axes.get_xticklabels()]
        assert all(min(to_rgb(text.get_color())) > 0.7 for text in texts if text.get_text())
    assert dict(rcParams) == before


def test_the_list_of_plots_cannot_be_changed() -> None:
    assert list(PLOTS) == ["overview", "joints", "torques", "energy", "tracking", "phase", "error_growth"]
    with pytest.raises(TypeError):
        PLOTS["mine"] = PLOTS["joints"]  # type: ignore[index]


def eight():
    """Eight joints with all that an overview may hold: a reference, torques, work of four sources, an estimate."""
    run = ur5()
    one = replace(many(run, 8), extremes=None)
    works = {f"source_{k}": np.sin(one.t + k) for k in range(4)}
    ledger = replace(run.ledger, kinetic=one.t, potential=np.cos(one.t), work=works)
    return replace(one, desired=one.q + 0.1, tracking_error=0.1 + 0 * one.q, ledger=ledger, error=run.error)


def test_the_overview_is_the_runs(run) -> None:
    """A row for each joint, with q and q_d, v, u and q_d − q; then energy, work, residual and estimated error."""
    figure, n = plot(run), len(run.joint_names)
    columns = [figure.axes[k : 4 * n : 4] for k in range(4)]
    for column, values, symbol in zip(
        columns, (run.q, run.v, run.u, run.tracking_error), ("q", "v", "u", "q_d − q"), strict=True
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
    assert not cells(figure, "q_d − q") and not cells(figure, "u") and "u is 0 throughout" in headings(figure)
    assert not any("Estimated" in axes.get_title(loc="left") for axes in figure.axes)
    assert "u is 0" not in headings(plot(run))
    unknown = plot(replace(cart, u=np.full_like(cart.u, np.nan)))  # not recorded, which is not 0
    assert not cells(unknown, "u") and "u is 0" not in headings(unknown)


@pytest.mark.parametrize("width", [80, *long([300]), *stress([120])])
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
    path = plot(run, "torques", width_mm=120, style="paper").save(tmp_path / f"run{suffix}")
    assert page in path.read_bytes() and b"<image" not in path.read_bytes()
    png = plot(run, "torques", width_mm=127).save(tmp_path / "run.png", dpi=100).read_bytes()
    assert int.from_bytes(png[16:20], "big") == 500


def test_many_remarks_leave_room_for_the_curves(run) -> None:
    """The last line says where the others are."""
    long = replace(
        run, outcome=Outcome(Reason.CANNOT_EVALUATE, run.outcome.t, facts={"error": "use a smaller step, " * 90})
    )
    figure = plot(long)
    assert figure.get_size_inches()[1] * MM <= 297 and "see the summary for all remarks" in headings(figure)
