"""Results and values at a prompt and in a notebook: text, tables, one picture; on light and dark pages in a browser."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from lxml import html

import robot_dyn as rd
from robot_dyn.foundations import Answer, Table, display, table
from tests.long import long
from tests.tools.identify import logs

ARM = rd.load("planar_2r")
Q = np.array([0.3, 0.4])
MOST_TEXT, MOST_HTML = 8000, 250_000  # characters

# What makes each result, as a cell of a notebook does.
CELLS = {
    "compare": "rd.compare(arm, samples=5)",
    "check": "rd.tools.doctor.check_urdf('kinova')",
    "diff_robots": "rd.tools.doctor.diff_robots(arm, arm.with_(mass_scale=1.1), samples=10)",
    "advise": "rd.advise(arm, q, duration_s=0.1, method='RK4', step_s=1e-3)",
    "prove": "rd.tools.proof.prove(rd.Setup(rd.Plant(arm), q, duration_s=0.2))",
    "certify": "rd.accuracy.certify(arm, samples=100, repeats=1)",
    "cost": "rd.accuracy.cost(arm, q, budget_s=0.1, repeats=2)",
    "work_precision": "rd.accuracy.work_precision(rd.Setup(rd.Plant(arm), q, duration_s=0.1),"
    " methods=['RK4', 'DOP853'], peers=False, budget_s=0.3, repeats=1)",
    "stress": "rd.tools.stress.stress(arm, samples=100, runs=0, budget_s=1.0)",
    "budget": "rd.tools.motors.budget(rd.control.quintic(q, q + 1, 1.0), arm, effort=50.0, velocity=9.0)",
    "identify": "rd.tools.identify.identify(logs.FILE, logs.log(), reference=logs.reference())",
    "excite": "rd.tools.identify.excite(arm, 5.0, limits={'lower': -2, 'upper': 2, 'velocity': 2.0, 'torque': 60.0},"
    " starts=1, compare_longer=False)",
    "info": "rd.info(rd.load('panda'))",
    "why": "rd.why(rd.Plant(arm, [rd.effects.DryFriction(0.7)]), q, q, q, 'joint_2')",
    "linearise": "rd.linearise(arm, q)",
    "task_dynamics": "rd.control.task_dynamics(arm, q, np.ones(2), 'tip', rows=(0, 2))",
}
ALWAYS_DRAWN = {"compare", "advise", "prove", "certify", "cost", "work_precision", "budget", "why"}  # with a figure
NAMES = [pytest.param(name, id=name) for name in CELLS]


@cache
def made(name: str) -> Any:
    return eval(CELLS[name], {"rd": rd, "logs": logs, "np": np, "arm": ARM, "q": Q})


def texts(result: Answer) -> list[str]:
    """All lines, and all cells that hold a word or a number, of a result."""
    blocks = list(result.blocks())
    cells = [cell for each in blocks if isinstance(each, Table) for row in each.cells for cell in row]
    return [each for each in [*blocks, *cells] if isinstance(each, str) and each.strip()]


@pytest.mark.parametrize("name", NAMES)
def test_a_result_says_its_text_as_text_and_as_html_that_needs_nothing_else(name: str) -> None:
    text, page = repr(made(name)), made(name)._repr_html_()
    assert "array(" not in text and len(text) < MOST_TEXT and len(page) < MOST_HTML
    assert all(each in text for each in texts(made(name)))
    assert not re.search(r"<script|<\?xml|(href|src)=\"(?!#)|url\((?!#)|javascript:|@import", page)
    tree = html.fragment_fromstring(page)
    shown = " ".join(tree.text_content().split()).replace("−", "-")
    if name != "check":  # it has a row for each finding
        assert not [each for each in texts(made(name)) if " ".join(each.split()).replace("−", "-") not in shown]
    assert len(list(tree.iter("tr"))) > 1 and bool(list(tree.iter("svg"))) == bool(made(name).drawing)
    assert made(name).drawing or name not in ALWAYS_DRAWN


@pytest.mark.parametrize("width", [10, 30, 60, 200])
def test_a_table_in_a_narrow_terminal_is_split_and_no_cell_is_cut(width: int) -> None:
    """Each column stands once, beside the first one; a part that is too wide has one column more alone."""
    whole = next(each for each in rd.info(rd.load("panda")).blocks() if isinstance(each, Table))
    parts = list(whole.within(width))
    assert {part.heading[0] for part in parts} == {whole.heading[0]}
    assert [name for part in parts for name in part.heading[1:]] == list(whole.heading[1:])
    assert [[cell for part in parts for cell in part.cells[k][1:]] for k in range(8)] == [x[1:] for x in whole.cells]
    assert all(len(part.heading) == 2 or max(map(len, part.lines)) <= width for part in parts)
    assert (len(parts) == 1) is (max(map(len, whole.lines)) <= width)


def test_the_columns_that_identify_a_row_stand_in_each_part_of_a_split_table() -> None:
    """In (quantity, by) no row occurs twice; numbers identify nothing; equal rows have the first column."""
    rows = tuple((quantity, by, 1.0, 2.0) for quantity in ("M", "C") for by in ("Pinocchio", "machine code"))
    table = Table(("quantity", "by", "typical", "searched"), rows)
    parts = list(table.within(32))
    assert [part.heading for part in parts] == [("quantity", "by", "typical"), ("quantity", "by", "searched")]
    assert all(len({row[:2] for row in part.rows}) == len(rows) for part in parts)
    assert Table(("a", "b", "c"), (("x", 1.0, "y"), ("x", 2.0, "z"))).keys == 1
    assert Table(("a", "b", "c"), (("x", "y", "z"), ("x", "y", "z"))).keys == 1


@pytest.mark.parametrize("width", [40, 60, 80, 110])
def test_a_table_of_long_texts_is_broken_between_words_only(width: int) -> None:
    """Every word, headings included, fits the width of its column, and the columns fit the line."""
    text = "the push grew 1.2e+04-fold (beyond limit of file, error told up to 0.129 s only)"
    rows = (("step", "Rodas5PFixed", 0.1, text, text), ("step", "MoreauJean", 0.25, "", text))
    table = Table(("of", "what", "value", "at 0.98 of value", "at 1.02 of value"), rows, wrap=True)
    for part in table.within(width):
        fitted = part.fitted(width)
        assert sum(fitted) + 2 * (len(fitted) - 1) <= width
        for letters, *column in zip(fitted, part.heading, *part.cells, strict=True):
            assert all(len(word) <= letters for cell in column for word in cell.split())


def test_a_checkup_has_a_row_for_each_finding() -> None:
    rows = [
        [cell.text_content() for cell in row.iter("td")]
        for row in html.fragment_fromstring(made("check")._repr_html_()).iter("tr")
    ]
    assert rows[1:] == [
        [x.severity.value, x.where, "" if x.line is None else str(x.line), x.message, x.remedy]
        for x in made("check").findings
    ]


def test_marks_on_a_logarithmic_axis_stand_where_the_logarithm_says() -> None:
    shares = {
        each.quantity: each.tolerance_fraction for each in made("compare").agreements if each.tolerance_fraction > 0
    }
    tree = html.fragment_fromstring(made("compare")._repr_html_())
    (levels,) = (each for each in tree.iter("g") if each.get("id") == "levels")
    at = [float(mark.get("x")) for mark in levels.iter("use")]
    assert np.corrcoef(at, np.log10(list(shares.values())))[0, 1] == pytest.approx(1.0, abs=1e-5)


def test_a_linearisation_is_the_pair_of_its_matrices() -> None:
    A, B = pair = made("linearise")
    assert pair[0] is A and pair.B is B and (A.shape, B.shape) == ((4, 4), (4, 2))
    shown = [[float(x) for x in row] for row in next(x for x in pair.blocks() if isinstance(x, Table)).rows]
    known = [x for x in np.linalg.eigvals(A) if x.imag >= 0]
    assert {complex(*row) for row in shown} == {complex(x) for x in known}


RUN = "rd.simulate(arm, q, duration_s=0.1, method='RK4', step_s=1e-3)"
PARTS: dict[str, Callable[[Any], Any]] = {
    "run": lambda run: run,
    "ledger": lambda run: run.ledger,
    "error": lambda run: run.error,
    "agreement": lambda _: made("compare").worst,
    "finding": lambda _: made("check").findings[0],
    "coriolis": lambda _: ARM.coriolis,
    "observed": lambda _: rd.rollouts(ARM, [Q, Q], duration_s=0.1, method="RK4", step_s=1e-3).observed,
    "event": lambda _: rd.Event(lambda t, q, v: q[0]),
    "payload": lambda _: rd.Payload("tip", 1.0),
    "robot": lambda _: ARM,
    "plant": lambda _: rd.Plant(ARM),
}


@pytest.mark.parametrize("name", list(PARTS))
def test_the_repr_of_what_is_around_results_is_short(name: str) -> None:
    text = repr(PARTS[name](rd.simulate(ARM, Q, duration_s=0.1, method="RK4", step_s=1e-3)))
    assert len(text) < 800 and "array(" not in text and "0x" not in text


SETUP = """
import numpy as np, robot_dyn as rd
from tests.tools.identify import logs
arm, q = rd.load('planar_2r'), np.array([0.3, 0.4])
"""


def executed(*cells: str) -> Any:
    import nbformat  # it and its parts take seconds to import, in every process that collects tests
    from nbclient import NotebookClient

    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(each) for each in (SETUP, *cells)])
    return NotebookClient(notebook, timeout=120, kernel_name="python3").execute()


@pytest.mark.parametrize("before", ["", *long(["%matplotlib inline", "import matplotlib.pyplot as plt"])])
def test_a_figure_that_a_cell_returns_is_one_picture(before: str) -> None:
    (output,) = executed(before, f"rd.plot({RUN}, 'joints')").cells[-1].outputs
    assert output.output_type == "execute_result" and set(output.data) == {"image/png", "text/plain"}


@pytest.mark.long
def test_a_browser_shows_every_result_on_light_and_dark_pages(tmp_path: Any, browser: Any) -> None:
    from nbconvert import HTMLExporter

    notebook = executed(*CELLS.values(), f"rd.plot({RUN}, 'joints')")
    for cell in notebook.cells[1:]:
        assert [output.output_type for output in cell.outputs] == ["execute_result"]
    for theme in ("light", "dark"):
        page = browser.new_page(viewport={"width": 1200, "height": 900})
        complaints: list[str] = []
        page.on("pageerror", lambda error, to=complaints: to.append(str(error)))
        (tmp_path / f"{theme}.html").write_text(HTMLExporter(theme=theme).from_notebook_node(notebook)[0], "utf-8")
        page.goto((tmp_path / f"{theme}.html").as_uri(), wait_until="domcontentloaded")
        blocks = page.locator(".robot-dyn")
        assert blocks.count() == len(CELLS) and not complaints
        for k, name in enumerate(CELLS):
            ink, paper, wrong = blocks.nth(k).evaluate(_LOOK)
            assert abs(luminance(ink) - luminance(paper)) > 0.4 and not wrong, (name, theme, wrong)
        assert page.locator("img").count() == 1


_LOOK = """block => {
  let paper = block;
  const clear = each => /, 0\\)|transparent/.test(getComputedStyle(each).backgroundColor);
  while (clear(paper) && paper.parentElement) paper = paper.parentElement;
  const names = (select, wrong) => [...block.querySelectorAll(select)].filter(wrong).map(each => each.textContent);
  const right = each => each.getBoundingClientRect().right;
  const inks = [getComputedStyle(block.querySelector('td')).color, getComputedStyle(paper).backgroundColor];
  return [...inks, [
    ...names('td:not(.n)', each => getComputedStyle(each).textAlign != 'left'),
    ...names('svg text', each => right(each) > right(each.closest('svg')) + 1),
    ...names('svg', each => each.getBoundingClientRect().width < 300),
  ]];
}"""


def luminance(colour: str) -> float:
    red, green, blue = (float(x) / 255 for x in re.findall(r"[\d.]+", colour)[:3])
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def curves_of(page: html.HtmlElement) -> list[np.ndarray]:
    """Points of the curves of a page, (k, 2) each, in pixels."""
    groups = (each for each in page.iter("g") if each.get("id", "").startswith("curve"))
    return [
        np.array(re.findall(r"-?[\d.]+", next(each.iter("path")).get("d")), float).reshape(-1, 2) for each in groups
    ]


LOADED = rd.load("planar_2r").with_(payload=rd.Payload("bar_2", 0.5))


def read(text: str) -> html.HtmlElement:
    assert "<script" not in text and "http" not in text.replace("http://www.w3.org/2000/svg", "")
    return html.fragment_fromstring(text)


def test_a_robot_shows_its_joints_limits_and_findings() -> None:
    page = read(LOADED._repr_html_())
    rows = [[cell.text_content() for cell in row.iter("td")] for row in page.iter("tr")][1:]
    assert [row[0] for row in rows] == list(LOADED.joint_names)
    assert [float(row[3].replace("—", "inf")) for row in rows] == pytest.approx(LOADED.upper, rel=1e-3)
    assert "0.5 kg on bar_2" in page.text_content()
    odd = rd.load("mimic_chain")
    assert all(finding in read(odd._repr_html_()).text_content() for finding in odd.findings)


def test_a_run_shows_its_summary_and_curves_of_its_samples() -> None:
    run = rd.simulate(LOADED, [0.3, 0.4], duration_s=0.5, method="RK4", step_s=1e-3)
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
    runs = rd.rollouts(LOADED, [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]], duration_s=0.1, method="RK4", step_s=1e-3)
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
    assert len(heights) <= display.MAX_POINTS and heights.count(min(heights)) == 1
    assert display.plot("x", t, {"x": np.full_like(t, np.nan)}) == ""
