"""Values in a notebook: what their HTML says is what they hold; it needs no script, and its colours are the page's."""

from __future__ import annotations

import re

import numpy as np
import pytest
from lxml import html

import robot_dyn as rd
from robot_dyn.foundations import display, table


def curves_of(page: html.HtmlElement) -> list[np.ndarray]:
    """Points of the curves of a page, (k, 2) each, in pixels."""
    groups = (each for each in page.iter("g") if each.get("id", "").startswith("curve"))
    return [
        np.array(re.findall(r"-?[\d.]+", next(each.iter("path")).get("d")), float).reshape(-1, 2) for each in groups
    ]


ARM = rd.load("planar_2r").with_(payload=rd.Payload("bar_2", 0.5))


def read(text: str) -> html.HtmlElement:
    assert "<script" not in text and "http" not in text.replace("http://www.w3.org/2000/svg", "")
    return html.fragment_fromstring(text)


def test_a_robot_shows_its_joints_limits_and_findings() -> None:
    page = read(ARM._repr_html_())
    rows = [[cell.text_content() for cell in row.iter("td")] for row in page.iter("tr")][1:]
    assert [row[0] for row in rows] == list(ARM.joint_names)
    assert [float(row[3].replace("—", "inf")) for row in rows] == pytest.approx(ARM.upper, rel=1e-3)
    assert "0.5 kg on bar_2" in page.text_content()
    odd = rd.load("mimic_chain")
    assert all(finding in read(odd._repr_html_()).text_content() for finding in odd.findings)


def test_a_run_shows_its_summary_and_curves_of_its_samples() -> None:
    run = rd.simulate(ARM, [0.3, 0.4], duration_s=0.5, integrator="rk4", step_s=1e-3)
    assert repr(run) == f"<Trajectory: {run.summary}>" and len(repr(run)) < 1000
    page = read(run._repr_html_())
    assert run.summary in page.text_content()
    curves = curves_of(page)
    assert len(curves) == 4  # q and v of two joints; no actuation
    for curve, x in zip(curves[:2], run.q.T, strict=True):  # pixels are linear in the samples, peaks included
        assert np.corrcoef(-curve[:, 1], np.interp(curve[:, 0], np.linspace(curve[0, 0], curve[-1, 0], len(x)), x))[
            0, 1
        ] == pytest.approx(1.0, abs=1e-3)
    assert len(run._repr_html_()) < 60_000


def test_a_batch_shows_the_range_of_its_runs() -> None:
    runs = rd.rollouts(ARM, [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]], duration_s=0.1, integrator="rk4", step_s=1e-3)
    assert repr(runs) == f"<Rollouts: {runs.summary}>"
    page = read(runs._repr_html_())
    assert runs.summary in page.text_content()
    assert len(curves_of(page)) == 6  # least, median and largest of two joints


def test_text_of_a_file_is_text_of_the_page() -> None:
    page = read(display.page("<b>", table(("<i>", "k"), [("<u>", 1e-3)]), display.text("<s>")))
    assert not list(page.iter("b", "i", "u", "s"))
    assert page.text_content().endswith("<b><i>k<u>0.001<s>")


def test_a_long_table_scrolls_and_is_whole() -> None:
    for count in (40, 41):
        page = read(display.page("long", table(("k",), [(k,) for k in range(count)])))
        assert len(list(page.iter("tr"))) == count + 1
        assert bool(page.find_class("l")) is (count > 40)


def test_curves_keep_their_peaks_and_leave_out_what_is_not_finite() -> None:
    t = np.linspace(0.0, 1.0, 10_001)
    x = np.zeros_like(t)
    x[3456], x[7000] = 1.0, np.nan
    page = read(f"<div>{display.plot('x [m]', t, {'x': x})}</div>")
    (curve,) = curves_of(page)
    heights = curve[:, 1].tolist()
    assert len(heights) <= display.MOST_POINTS and heights.count(min(heights)) == 1
    assert display.plot("x", t, {"x": np.full_like(t, np.nan)}) == ""
