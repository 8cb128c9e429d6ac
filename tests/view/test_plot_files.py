"""Plots of runs that are odd, long or many-jointed, and the files they are written to."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np
import pytest
from matplotlib import rcParams
from matplotlib.colors import to_rgb

from robot_dyn.simulation.results.ledger import Ledger
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.view.plots.plots import MOST_JOINTS, PLOTS, PlotError, plot, save_plot
from tests.plotted import cart_pole, cells, many, stretched, ur5


@pytest.fixture(scope="module")
def run():
    return ur5()


@pytest.fixture(scope="module")
def cart():
    return cart_pole()


@pytest.mark.parametrize(
    "suffix, opening", [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".PDF", b"%PDF"), ("", b"\x89PNG")]
)
def test_the_suffix_says_the_format(cart, tmp_path, suffix: str, opening: bytes) -> None:
    path = save_plot(cart, tmp_path / f"plot{suffix}", "joints", dpi=40, theme="dark")
    assert path.read_bytes().startswith(opening) and path.suffix == (suffix or ".png")


def test_targets_that_cannot_be_written_are_refused(cart, tmp_path) -> None:
    with pytest.raises(PlotError, match=r"'.jpeg' is not the suffix of a plot; .*\.png, \.svg, \.pdf"):
        save_plot(cart, tmp_path / "plot.jpeg")
    with pytest.raises(PlotError, match="is a folder"):
        save_plot(cart, tmp_path)
    with pytest.raises(PlotError, match="there is no folder"):
        save_plot(cart, tmp_path / "no folder" / "plot.png", "joints", dpi=40)
    with pytest.raises(PlotError, match="cannot be drawn at 50000 dpi"):
        save_plot(cart, tmp_path / "plot.png", "joints", dpi=50_000)


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
    save_plot(one, tmp_path / "one.png", dpi=40)
    assert {line.get_marker() for axes in cells(plot(one, "joints"), "q") for line in axes.lines} == {"o"}


def test_a_diverged_run_shows_how_it_began_and_how_it_ended(cart, tmp_path) -> None:
    """What is not finite is left out, and the scale has room for 0.1 and 1e200."""
    growth = np.exp(np.linspace(0, 460, 200))[:, None] * [0.1, -0.1]
    growth[-3:] = [[np.nan], [np.inf], [np.nan]]
    energy = Ledger(growth[:, 0], growth[:, 1], {"control": growth[:, 0]})
    end = Outcome(Ending.DIVERGED, 5.0, "take a smaller step")
    fast = {"q": growth, "v": growth, "u": growth, "ledger": energy, "outcome": end}
    run = stretched(cart, 200, **fast, deviation=growth, desired=growth)
    save_plot(run, tmp_path / "diverged.png", dpi=40)
    figure = plot(run)
    assert all(np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all() for axes in figure.axes)
    assert {axes.get_yscale() for axes in cells(figure, "q")} == {"symlog"}
    assert any("take a smaller step" in text.get_text() for text in figure.texts)
    nothing = np.full((200, 2), np.nan)
    save_plot(stretched(run, 200, q=nothing, v=nothing, u=nothing), tmp_path / "nan.png", dpi=40)


def test_thirty_joints_keep_their_names_and_do_not_overlap(run) -> None:
    figure = plot(many(run, 30), "joints")
    figure.draw_without_rendering()
    assert [axes.get_title(loc="left") for axes in cells(figure, "q")] == [f"joint_{i:02d}" for i in range(30)]
    boxes = [axes.get_window_extent() for axes in figure.axes]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    page = figure.bbox
    assert all(page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1 for box in boxes)
    with pytest.raises(PlotError, match=f"1 to {MOST_JOINTS}; name those to show"):
        plot(many(run, MOST_JOINTS + 1), "joints")


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
    assert list(PLOTS) == ["joints", "torques", "energy", "tracking", "phase", "error_growth"]
    with pytest.raises(TypeError):
        PLOTS["mine"] = PLOTS["joints"]  # type: ignore[index]
