"""Questions to a sweep: failures are counted, unknown events are refused, and pages and tables hold the rows."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binomtest

import robot_dyn as rd
from robot_dyn.foundations import SweepError
from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps import Work
from robot_dyn.tools.sweeps.rows import FIXED
from tests.tools.sweeps.swept import SCENE, VARY, scene, swept

WEAK = """
robot = "planar_2r"
duration_s = 0.2
method = "RK4"
step_s = 0.002
record_every_s = 0.02
start = {q = [0.4, 0.3]}
effect = [
  {kind = "gravity"},
  {kind = "effort_limit", limit_N_m = [1.5, 8.0]},
  {kind = "dry_friction", coulomb_N_m = [1.0, 3.0]},
]
control = {kind = "pd", kp = 20.0, kd = 2.0}
reference = {kind = "quintic", q = {joint_1 = 0.5, joint_2 = 0.31}, duration_s = 0.2}
"""


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> sw.SweepResult:
    folder = tmp_path_factory.mktemp("sweep")
    return sw.run(swept(folder, 400), folder / "out", chunk=64)


def test_runs_that_fail_are_rows_with_a_reason(done: sw.SweepResult) -> None:
    table = done.table()
    failed = table["outcome"] != "finished"
    assert 0 < failed.sum() < 400 and (table["why"][failed] != "").all()
    raised = table["outcome"] == "raised"
    assert (raised == (table["mass_scale"] <= 0)).all()
    assert all("mass_scale must be positive" in text for text in table["why"][raised])
    assert np.isnan(table["error"][failed]).all() and np.isfinite(table["error"][~failed]).all()
    assert sum(done.reasons().values()) == failed.sum()
    assert done.reasons()["raised"] == raised.sum()


def test_remarks_of_rows_are_those_of_rollouts(tmp_path: Path) -> None:
    """A weak motor, and friction that holds a joint in some runs; of each run alone, whatever the chunks."""
    path = scene(tmp_path, WEAK)
    plan = sw.Sweep(
        str(path), 20, {"mass_scale": sw.uniform(low=0.2, high=3.0)}, {"error": sw.rms_tracking_error()}, seed=3
    )
    done = sw.run(plan, tmp_path / "a", chunk=20)
    rows = done.table("mass_scale", "remarks")
    runs = rd.rollouts(plan.setup, vary={"mass_scale": rows["mass_scale"]})
    assert rows["remarks"].tolist() == runs.table()["remarks"].tolist()
    assert sw.run(plan, tmp_path / "b", chunk=7).table("remarks")["remarks"].tolist() == rows["remarks"].tolist()
    for text, count in (done.remarks or {}).items():
        assert count == sum(text in each for each in rows["remarks"])
        assert f"remark on {count} of 20 runs: {text}" in str(done)
    kinds = " ".join(done.remarks or {})
    assert "effort_limit_reached" in kinds and "held_while_reference_moves" in kinds


def test_a_figure_that_finished_runs_have_not_is_no_failure(tmp_path: Path, monkeypatch) -> None:
    """Of runs whose figure is nan: mean, probability and sensitivity say so, and are those of the others if asked."""
    (tmp_path / "no_figure.py").write_text(
        "def late(run):\n    return run.q[-1, 0] if run.q[0, 0] > 0.4 else float('nan')\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    vary = {"q0": sw.normal(mean=[0.4, 0.9], sd=0.1)}
    done = sw.run(swept(tmp_path, 200, vary=vary, figures={"late": "no_figure:late"}), tmp_path / "out")
    x = done.table("late")["late"]
    some = np.isfinite(x)
    assert done.outcomes == {"finished": 200, "diverged": 0, "raised": 0} and 50 < some.sum() < 150
    for ask in (done.mean, done.sensitivity):
        with pytest.raises(SweepError, match=rf"{(~some).sum()} runs that finished, .*condition='known'"):
            ask("late", condition="finished")
    assert done.mean("late", condition="known").estimate == pytest.approx(x[some].mean(), rel=1e-12)
    assert "mean of late given known" in str(done.mean("late", condition="known"))
    with pytest.raises(SweepError, match=r"some finished, but have no figure: pass condition='known'"):
        done.probability("failed | late > 0.45")
    assert done.probability("late > 0.45", condition="known").estimate == (x[some] > 0.45).mean()
    assert set(done.worst("late", 200, condition="known")) == set(np.flatnonzero(some))
    assert "sensitivity of late given known" in str(done.sensitivity("late", condition="known"))


def test_quantiles_count_failures_as_infinite(done: sw.SweepResult) -> None:
    x = done.table("error")["error"]
    counted = np.sort(np.where(np.isnan(x), np.inf, x))
    (median,) = done.quantiles("error", [0.5])
    assert median.estimate == counted[199] and median.failed == np.isnan(x).sum() > 0
    (last,) = done.quantiles("error", [0.999])
    assert last.estimate == np.inf


@pytest.mark.parametrize("level", [0.9, 0.95])
def test_a_probability_has_the_interval_of_clopper_and_pearson(done: sw.SweepResult, level: float) -> None:
    failed = int((done.table("outcome")["outcome"] != "finished").sum())
    expected = binomtest(failed, 400).proportion_ci(level, method="exact")
    made = done.probability("failed", level)
    assert (made.low, made.high) == pytest.approx((expected.low, expected.high), rel=1e-9)


def test_functions_that_are_given_otherwise_than_by_name_are_refused_with_a_figure(done: sw.SweepResult) -> None:
    with pytest.raises(SweepError, match=r"^figures: give them by name, as \{'settling': "):
        sw.read_sweep(done.path, figures=["late"])  # pyright: ignore[reportArgumentType]


def test_an_event_that_is_unknown_in_failed_runs_is_refused(done: sw.SweepResult) -> None:
    table = done.table("error", "outcome")
    failed = table["outcome"] != "finished"
    events = failed | (table["error"] > 0.05)
    assert done.probability("failed | error > 0.05").estimate == events.mean()
    with pytest.raises(SweepError, match=rf"unknown in {failed.sum()} runs, such as run 2: write 'failed \| error"):
        done.probability("error > 0.05")
    given = done.probability("error > 0.05", condition="finished")
    assert given.n == 400 - failed.sum() and "given finished" in given.statistic


def test_means_and_sensitivities_of_failed_runs_are_refused(done: sw.SweepResult) -> None:
    for question in (done.mean, done.sensitivity):
        with pytest.raises(SweepError, match=r"condition='finished'"):
            question("error")
    x = done.table("error")["error"]
    assert done.mean("error", condition="finished").estimate == pytest.approx(np.nanmean(x), rel=1e-12)


def test_a_question_about_no_run_is_refused(tmp_path: Path) -> None:
    done = sw.run(swept(tmp_path, 20, vary={"kd": sw.choice([4e6])}), tmp_path / "out", chunk=20)
    for ask in (
        lambda: done.quantiles("end", condition="finished"),
        lambda: done.probability("kd > 1", condition="finished"),
    ):
        with pytest.raises(SweepError, match="no run is left with condition='finished'"):
            ask()


def test_worst_runs_are_those_that_failed_then_the_largest(done: sw.SweepResult) -> None:
    x = done.table("error")["error"]
    failed = np.flatnonzero(np.isnan(x)).tolist()
    worst = done.worst("error", len(failed) + 2)
    assert list(worst[:-2]) == failed
    assert worst[-2:] == done.worst("error", 2, condition="finished")
    assert x[list(worst[-2:])].tolist() == sorted(x[~np.isnan(x)])[::-1][:2]


def test_a_run_that_raised_says_why(done: sw.SweepResult) -> None:
    run = int((done.table("outcome")["outcome"] == "raised").argmax())
    with pytest.raises(SweepError, match=f"run {run} raised: .*mass_scale must be positive"):
        done.run(run)


def test_scramblings_are_told_from_independent_runs(tmp_path: Path) -> None:
    vary = {"q0": sw.normal(mean=[0.4, 0.9], sd=0.1)}
    done = sw.run(swept(tmp_path, 512, vary=vary, design="sobol"), tmp_path / "out")
    assert "16 scramblings" in done.mean("error").method
    assert "16 scramblings" in done.probability("error > 0.05").method
    saltelli = sw.run(swept(tmp_path, 512, vary=vary, design="saltelli"), tmp_path / "saltelli")
    assert [each.statistic for each in saltelli.sensitivity("end").total] == [
        "total index of q0[0]", "total index of q0[1]"
    ]  # fmt: skip


def test_a_table_of_ones_own_is_a_design(tmp_path: Path) -> None:
    rows = np.array([[0.5, 0.25], [0.1, 0.9], [0.9, 0.1]])
    vary = {"kp": sw.uniform(low=10.0, high=20.0), "kd": sw.uniform(low=1.0, high=2.0)}
    done = sw.run(swept(tmp_path, 3, vary=vary, design=rows), tmp_path / "out", chunk=2)
    assert done.table("kp")["kp"].tolist() == pytest.approx([15.0, 11.0, 19.0])
    assert sw.read_sweep(tmp_path / "out").verify() == done.verify()  # the table is in the folder
    with pytest.raises(SweepError, match="rows_sha256"):
        sw.run(swept(tmp_path, 3, vary=vary, design=rows + 0.01), tmp_path / "out")


def test_a_csv_holds_the_table_to_the_bit(done: sw.SweepResult, tmp_path: Path) -> None:
    with open(done.save(tmp_path / "rows.csv"), newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    table = done.table()
    fixed = [f"{column.name} [{column.unit}]" if column.unit else column.name for column in FIXED]
    assert len(rows) == 400 and list(rows[0]) == [
        *("run", "viscous_friction.viscous [N m s/rad]", "q0[0] [rad]", "q0[1] [rad]", "mass_scale", "kd [N m s/rad]"),
        *("error [rad]", "peak [rad/s]", "end [rad]", *fixed),
    ]
    for heading, x in zip(rows[0], table.values(), strict=True):
        if x.dtype.kind == "f":
            np.testing.assert_array_equal([float(row[heading]) for row in rows], x)
        else:
            assert [row[heading] for row in rows] == [str(each) for each in x]


def test_a_parquet_file_says_what_its_columns_are(done: sw.SweepResult, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    back, table = parquet.read_table(done.save(tmp_path / "rows.parquet")), done.table()
    for heading, x in zip(back.column_names, table.values(), strict=True):
        np.testing.assert_array_equal(back[heading].to_numpy(zero_copy_only=False), x)
    of = {field.name: field.metadata or {} for field in back.schema}
    assert of["peak [rad/s]"][b"unit"] == b"rad/s" and b"peak" in of["peak [rad/s]"][b"computed by"]
    for column in FIXED:
        heading = f"{column.name} [{column.unit}]" if column.unit else column.name
        assert of[heading][b"meaning"].decode() == column.meaning == done.columns[column.name]
    assert of["q0[1] [rad]"][b"distribution"] == json.dumps(VARY["q0"].to_dict()).encode()
    stated = json.loads(back.schema.metadata[b"sweep"])
    assert stated["seed"] == 3 and stated["setup"]["robot"] == "planar_2r" and stated["scene"] == "scene.toml"
    assert str(tmp_path.parent) not in back.schema.metadata[b"sweep"].decode()


def test_a_run_repeated_by_its_setup_is_that_of_the_sweep(done: sw.SweepResult) -> None:
    """Interpreted and with its error; rounding alone differs."""
    i = int(np.flatnonzero(done.table("outcome")["outcome"] == "finished")[0])
    run, again = done.run(i), rd.simulate(done.setup_of(i))
    assert run.outcome.ending == again.outcome.ending and again.error is not None
    np.testing.assert_allclose(again.q, run.q, rtol=0, atol=1e-12)


def test_the_report_has_each_figure_and_the_lines_that_repeat_runs(done: sw.SweepResult, tmp_path: Path) -> None:
    text = done.save(tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<script" not in text and "default-src 'none'" in text
    for name in done.sweep.figures:
        assert f"<h2>{name} [{done.units[name]}]</h2>" in text
    assert f".run({done.worst('error', 1, condition='finished')[0]})" in text
    assert text.count("<svg") == 1 + len(done.sweep.figures)


# --- figures that users write

MODULE = """
def last(run):
    return float(run.q[-1, 0])

last.record = ("q",)

def fails_sometimes(run):
    if run.varied["q0"][0] > 0.45:
        raise ValueError("beyond the table")
    return run.t[-1]

def text(run):
    return "long"
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "figures_of_a_test.py"
    path.write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "figures_of_a_test", raising=False)
    return path


QUIET = {"q0": VARY["q0"]}


def test_a_function_of_a_run_is_a_figure(tmp_path: Path, module: Path) -> None:
    figures = {"mine": "figures_of_a_test:last", "kp": sw.final("q", "joint_1")}  # kp does not vary
    done = sw.run(swept(tmp_path, 70, vary=QUIET, figures=figures), tmp_path / "out", chunk=30)
    table = done.table("mine", "kp")
    assert table["mine"].tolist() == table["kp"].tolist()


def test_a_module_that_changed_is_refused(tmp_path: Path, module: Path) -> None:
    sweep = swept(tmp_path, 70, vary=QUIET, figures={"mine": "figures_of_a_test:last"})
    sw.run(sweep, tmp_path / "out")
    module.write_text(MODULE + "\n# changed\n")
    with pytest.raises(SweepError, match=r"figures\.mine\.sha256 is"):
        sw.run(sweep, tmp_path / "out")
    with pytest.raises(SweepError, match="is not the file of the sweep"):
        sw.read_sweep(tmp_path / "out", figures={"mine": "figures_of_a_test:last"})


def test_a_figure_that_raises_makes_its_run_one_that_raised(tmp_path: Path, module: Path) -> None:
    figures = {"mine": "figures_of_a_test:fails_sometimes"}
    done = sw.run(swept(tmp_path, 70, vary=QUIET, figures=figures), tmp_path / "out", chunk=30)
    table = done.table()
    raised = table["outcome"] == "raised"
    assert (raised == (table["q0[0]"] > 0.45)).all() and raised.any()
    assert all("figure mine: line" in text and "beyond the table" in text for text in table["why"][raised])


CODE = "figures_of_a_test"
WRONG: dict[str, dict[str, Any]] = {
    "none of the 64 pilot runs finishes.*return a number": {"figures": {"mine": f"{CODE}:text"}},
    "figures_of_a_test:absent cannot be imported": {"figures": {"mine": f"{CODE}:absent"}},
    "no_such_module_here:f cannot be imported": {"figures": {"mine": "no_such_module_here:f"}},
    "'a.settling' is not .*or an import path such as 'my_figures:settling'": {"figures": {"mine": "a.settling"}},
    "no figure 'settling'.*or an import path such as 'my_figures:settling'": {"figures": {"mine": "settling"}},
    "which other processes cannot import: write it to my_figures.py": {"figures": {"mine": lambda run: 0.0}},
    "'diverged' is the name of another column": {"figures": {"diverged": sw.rms_tracking_error()}},
    "'q0.0.' is the name of another column": {"figures": {"q0[0]": sw.rms_tracking_error()}},
    "needs a joint": {"figures": {"mine": sw.final("q")}},
    "no joint 'elbow'; known: joint_1, joint_2": {"figures": {"mine": sw.peak("u", "elbow")}},
    "the arm has no payload": {"vary": {"payload_mass:tool0": sw.uniform(low=0, high=3)}},
    "no parameter 'kq'; ": {"vary": {"kq": sw.uniform(low=0, high=3)}},
    "q0 has 2 numbers, got a distribution of 1": {"vary": {"q0": sw.uniform(low=0, high=3)}},
    "nothing varies": {"vary": {}},
    "vary: kp: a distribution must be": {"vary": {"kp": 3.0}},
    "nearest: 64 or 128": {"design": "sobol"},
    "runs must be": {"runs": 0},
    "seed must be": {"seed": -1},
}


@pytest.mark.parametrize("said", WRONG)
def test_sweeps_that_cannot_be_are_refused(tmp_path: Path, module: Path, said: str) -> None:
    with pytest.raises(SweepError, match=said):
        sw.run(swept(tmp_path, **{"runs": 70, "vary": QUIET} | WRONG[said]), tmp_path / "out")


def test_a_setup_is_refused_with_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(SweepError, match="give a scene file, or a function that returns the setup"):
        sw.Sweep(swept(tmp_path).setup, 10, QUIET)  # pyright: ignore[reportArgumentType]


def test_runs_that_end_by_an_event_keep_their_figures_whatever_is_beside_them(tmp_path: Path) -> None:
    """Samples of a run that ends early are padded to those of the longest beside it; sums do not depend on that."""
    module = tmp_path / "setup_with_an_event.py"
    module.write_text(
        "import robot_dyn as rd\n"
        "def reached(t, q, v):\n    return q[0] - 0.45\n"
        "def setup():\n"
        "    arm = rd.load('planar_2r')\n"
        "    control = rd.control.PD(rd.control.hold([0.6, 0.9]), kp=40.0, kd=4.0)\n"
        "    return rd.Setup(rd.Plant(arm), [0.4, 0.9], duration_s=0.1, controller=control, method='RK4',\n"
        "                    events=rd.Event(reached, terminal=True), record_every_s=0.001)\n"
    )
    sys.path.insert(0, str(tmp_path))
    try:
        sweep = sw.Sweep("setup_with_an_event:setup", 24, {"q0": sw.normal(mean=[0.4, 0.9], sd=0.1)},
                         {"error": sw.rms_tracking_error()}, seed=2)  # fmt: skip
        rows = Work(sweep).rows(0, 24)
        assert len(set(rows["ended_s"].tolist())) > 2
        alone = [Work(sweep).rows(i, i + 1) for i in range(0, 24, 5)]
    finally:
        sys.path.remove(str(tmp_path))
    assert [each["error"][0] for each in alone] == rows["error"][::5].tolist()


def test_a_scene_states_a_sweep_as_data(tmp_path: Path) -> None:
    table = """
[sweep]
runs = 70
vary = {kp = "uniform(low=10, high=20)"}
figures = {worst = "peak('tracking_error')"}
"""
    path = scene(tmp_path, SCENE + table)
    sweep = sw.from_scene(path, seed=3)
    assert (sweep.runs, sweep.seed, sweep.figures) == (70, 3, {"worst": sw.peak("tracking_error")})
    for text, said in (
        ('"my_module:f"', "would run code, but a scene is data"),
        ("\"peak(__import__('os'))\"", "is not a name with arguments"),
        ("\"peek('u')\"", "no figure 'peek'; nearest: peak"),
    ):
        path.write_text(SCENE + table.replace("\"peak('tracking_error')\"", text))
        with pytest.raises(SweepError, match=said):
            sw.from_scene(path)


def test_units_of_figures_are_those_of_their_joints_and_of_a_frame() -> None:
    cart = rd.Setup(rd.Plant(rd.load("cart_pole")), [0.0, 0.1], duration_s=0.1)
    first, second = cart.plant.dynamics.joint_names
    assert [sw.peak("u").unit(cart), sw.peak("u", first).unit(cart), sw.final("v", second).unit(cart)] == [
        "N or N m", "N", "rad/s"
    ]  # fmt: skip
    arm = rd.load("ur5")
    path = rd.control.circle([0.4, 0.2, 0.3], 0.05, [0.0, 0.0, 1.0], 2.0)
    follows = rd.control.OperationalSpace(arm, "tool0", path, kp=100.0, kd=20.0)
    assert (
        sw.rms_tracking_error().unit(rd.Setup(rd.Plant(arm), np.full(6, 0.3), duration_s=0.1, controller=follows))
        == "m"
    )
