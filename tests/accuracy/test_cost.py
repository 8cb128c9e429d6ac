"""What effects and algorithms cost: counts that are those of the programs run, parts that add up, reasons in words."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.accuracy.costs import step_cost
from robot_dyn.accuracy.costs.ab_comparison import ABComparison, Version, take_turns
from robot_dyn.accuracy.costs.cost import cost_rows
from robot_dyn.accuracy.costs.diagram import draw
from robot_dyn.accuracy.costs.query_cost import QueryCost
from robot_dyn.codegen import program_of
from robot_dyn.codegen.parameters import parameters
from robot_dyn.foundations import QueryError, json_text
from robot_dyn.report import Budget
from robot_dyn.scene import starter
from robot_dyn.simulation import StateEquation, machine_code
from robot_dyn.simulation.compiled.cache import machine_code_of_constants
from tests.chains import body, chain
from tests.long import third

ARM = rd.load("planar_2r")
Q, V = np.array([0.4, -0.7]), np.array([0.3, 0.5])
FRICTION, SPRING = rd.effects.ViscousFriction([0.3, 0.2]), rd.effects.Spring([3.0, 2.0], [0.1, -0.2])
TINY: dict[str, Any] = {"budget_s": 1e-9, "repeats": 1}  # nothing is timed


def setup(*effects: Any, **options: Any) -> rd.Setup:
    return rd.Setup(rd.Plant(ARM, effects), Q, V, 0.1, **options)


def compiled(of: rd.Setup) -> dict[str, int]:
    """Instructions of the programs that `simulate` runs, by name."""
    made = machine_code(StateEquation(of.plant, of.controller), rd.integrate.method("RK4"))
    return {name: len(program) for name, program in made.code.programs.items()}


CONTROLLERS = {
    "none": None, "continuous": rd.control.PD(rd.control.hold(Q), kp=10.0, kd=1.0),
    "sampled": rd.control.PD(rd.control.hold(Q), kp=10.0, kd=1.0, period_s=0.01),
    "states": rd.control.PID(rd.control.hold(Q), kp=10.0, ki=2.0, kd=1.0, period_s=0.01),
}  # fmt: skip


@pytest.mark.parametrize("control", CONTROLLERS)
def test_counts_are_those_of_the_programs_that_are_run(control: str) -> None:
    """Four evaluations and, where control is sampled, a tick; without a part, those of a setup made without it."""
    controller = CONTROLLERS[control]
    given = setup(FRICTION, SPRING, controller=controller)
    found = rd.accuracy.cost(given, **TINY)
    without = {
        "viscous_friction": setup(SPRING, controller=controller),
        "spring": setup(FRICTION, controller=controller),
        "gravity": rd.Setup(rd.Plant(ARM.with_(gravity=(0, 0, 0)), given.plant.effects), Q, V, 0.1, controller),
    } | ({"control": setup(FRICTION, SPRING)} if controller else {})
    assert {each.name for each in found.alternatives if each.group == "parts"} == {*without, step_cost.EVERYTHING}
    for name, other in without.items():
        row = found.comparison(name)
        for version, of in ((row.first, given), (row.second, other)):
            counts = compiled(of)
            assert version.instructions == 4 * counts["rate"] + counts.get("tick", 0)
    bare = compiled(rd.Setup(rd.Plant(ARM.with_(gravity=(0, 0, 0))), Q, V))
    assert found.comparison(step_cost.EVERYTHING).second.instructions == 4 * bare["rate"]


def test_viscous_friction_costs_what_is_counted_by_hand() -> None:
    """Of two joints: b v, its torque from the sum, and τᵀ v of the ledger, −(b₁v₁)v₁ − (b₂v₂)v₂: some sign each.

    2 products b v and 2 sums; 2 products and 1 sum of the power: 7, and at most 3 changes of sign.
    """
    added = rd.accuracy.cost(setup(FRICTION), **TINY).parts["viscous_friction"]
    assert added % 4 == 0 and 7 <= added // 4 <= 10


@pytest.mark.parametrize("control", ["states", *third(["none", "continuous", "sampled"])])
def test_what_is_off_costs_nothing_and_parts_add_up(control: str) -> None:
    """All on = rigid bodies + each part + what several share; a part never adds to a setup that is without it."""
    given = setup(FRICTION, SPRING, *rd.effects.joint_stops(-1.0, 1.0), controller=CONTROLLERS[control])
    found = rd.accuracy.cost(given, **TINY)
    whole = found.comparison(step_cost.EVERYTHING)
    assert whole.second.instructions + sum(found.parts.values()) + found.shared == whole.first.instructions
    assert all(count > 0 for count in found.parts.values())
    assert abs(found.shared) <= sum(found.parts.values()) / 10
    again = rd.accuracy.cost(replace(given, plant=rd.Plant(ARM, [SPRING, *given.plant.effects[2:]])), **TINY)
    assert (
        again.comparison(step_cost.EVERYTHING).first.instructions
        == found.comparison("viscous_friction").second.instructions
    )
    assert "viscous_friction" not in again.parts


def test_algorithms_are_counted_from_the_kernels_of_compiled() -> None:
    """The least of each formulation is that of the kernel of the same query."""
    arm = rd.load("ur5")
    pairs = {name: make() for name, make in QueryCost(arm).pairs()}
    own: Any = rd.compiled(arm)
    count = {name: len(own.engine.kernels[name].program) for name in ("C", "coriolis_torque", "forward_dynamics")}
    derivatives = len(own.engine.kernels["forward_dynamics_derivatives"].program)
    matrix = pairs["Coriolis matrix"]
    assert (matrix.first.instructions, matrix.second.instructions) == (count["C"], count["coriolis_torque"])
    forward = pairs["forward dynamics"]
    assert min(forward.first.instructions, forward.second.instructions) == count["forward_dynamics"]
    differences = pairs["derivatives of forward dynamics"]
    assert differences.first.instructions == 36 * count["forward_dynamics"]
    assert differences.second.instructions == derivatives
    angles = pairs["right angles of the file"]
    assert angles.first.instructions > angles.second.instructions == count["forward_dynamics"]
    rest = pairs["C(q, v) v in forward dynamics"]
    assert rest.first.instructions == count["forward_dynamics"] > rest.second.instructions
    floats = pairs["numbers of forward dynamics"]
    assert floats.first.instructions == floats.second.instructions


def test_forward_dynamics_without_coriolis_torque_is_that_at_rest() -> None:
    """FD(q, v, τ + C v) = FD(q, 0, τ): what is counted as off computes the right side, to rounding of M⁻¹ τ."""
    cost = QueryCost(ARM)
    made = cost.at_rest
    q, v, tau = np.random.default_rng(3).normal(size=(3, 2))
    theirs = ARM.forward_dynamics(q, v, tau + ARM.coriolis_torque(q, v))
    np.testing.assert_allclose(made(q, v, tau).full().ravel(), theirs, rtol=1e-12, atol=1e-12)
    assert len(program_of(made)) == cost._coriolis_torque()[1].instructions


def test_machine_code_of_constants_has_no_inputs_and_the_numbers_of_its_robot() -> None:
    """Two robots that differ in gravity alone: nothing kept of the first is taken for the second."""
    for gravity in ((0.0, 0.0, -9.81), (0.0, 0.0, -3.7)):
        plant = rd.Plant(ARM.with_(gravity=gravity), [FRICTION])
        equation = StateEquation(plant, None)
        made = machine_code_of_constants(equation, rd.integrate.method("RK4"))
        assert made.parameters.size == 0 < sum(each.size for each in parameters(ARM, plant.effects, None))
        y, out = np.array([*Q, *V, 0.0, 0.0]), np.empty((8, 1))
        made.in_python.rate(0.0, y, np.array([0.0, 1.0]), np.zeros((1, 1)), out)
        theirs = plant.forward_dynamics(Q, V, np.zeros(2), t=0.0)
        np.testing.assert_allclose(out[2:4, 0], theirs, rtol=1e-12)


def test_what_cannot_be_done_is_said_with_the_reason() -> None:
    follows = chain(*[body(0.7, "0.1 0 0", 0.02)] * 2, last='<mimic joint="j1"/>')
    coupled = rd.accuracy.cost(rd.Robot.from_text(follows), [0.3], **TINY)
    assert any("joints are coupled" in each for each in coupled.left_out)
    assert any("right angles of the file: the file states all right angles" in each for each in coupled.left_out)

    class Odd(rd.effects.Dissipative):
        def torque(self, dynamics: Any, t: float, q: Any, v: Any) -> Any:
            return -np.array([float(x) for x in v])

    odd = rd.accuracy.cost(setup(Odd()), **TINY)
    assert any("parts: effect odd cannot be compiled" in each for each in odd.left_out)
    assert odd.sentence == "no step was counted" and odd.comparison("forward dynamics")
    with pytest.raises(QueryError, match="no cost of 'wind'; known: Coriolis matrix"):
        odd.comparison("wind")


def test_long_programs_are_counted_and_not_timed(monkeypatch) -> None:
    monkeypatch.setattr("robot_dyn.accuracy.costs.query_cost._MAX_TIMED", 30)
    found = rd.accuracy.cost(setup(), budget_s=20.0, repeats=1)
    row = found.comparison("forward dynamics")
    assert row.first.instructions > 30 and not row.first.times
    why = f"time of forward dynamics, M, Cholesky: {row.first.instructions} instructions, more than 30, take too long"
    assert any(each.startswith(why) for each in found.left_out)


def test_the_page_has_the_counts_of_today(tmp_path) -> None:
    """Those of the parts; `python scripts/cost.py` makes its table and figure."""
    scene = tmp_path / "scene.toml"
    scene.write_text(starter("panda_computed_torque"), encoding="utf-8")
    pairs = step_cost.pairs_of_parts(rd.read_scene(scene))
    counted = {each.name: f"{each.first.instructions} / {each.second.instructions}" for each in pairs}
    page = (Path(__file__).parents[2] / "docs" / "studies" / "cost.md").read_text(encoding="utf-8")
    told = re.findall(r"^\|[^|]*\| (\w+) \| on / off \| (\d+ / \d+) \|", page, flags=re.MULTILINE)
    assert dict(told) == counted


def test_a_budget_that_ends_says_what_was_not_timed() -> None:
    found = rd.accuracy.cost(setup(), **TINY)
    assert all(each.time_ratio is None and each.first.repeats == 0 for each in found.alternatives)
    assert "time of everything, on: the budget of 1e-09 s ended" in found.left_out


def test_times_are_the_least_of_turns_and_what_fails_is_left_out() -> None:
    """Of runs that take 1, 2, … each turn; the same run in two versions runs once a turn."""
    said: list[str] = []

    def runs(name: str, *times: float) -> Version:
        left = [0.0, *times]  # the first loads

        def run() -> float:
            said.append(name)
            return left.pop(0)

        return Version(name, 10, run)

    def broken() -> float:
        raise RobotDynError("no such code")

    first, second = runs("a", 5.0, 1.0, 3.0), runs("b", 2.0, 2.0, 2.0)
    pairs = [ABComparison("algorithms", what, "state", first, second) for what in ("sum", "again")]
    bad = ABComparison("algorithms", "bad", "state", Version("x", 1, broken), second)
    (pair, again, failed), left_out = take_turns([*pairs, bad], Budget(1e3), 3)
    assert left_out == ["time of bad, x: no such code"] and failed.time_ratio is None
    assert pair.first == again.first == Version("a", 10, times=(5.0, 1.0, 3.0))
    assert (pair.first.time_s, pair.first.repeats, pair.first.repeatable) == (1.0, 3, False)
    assert said == ["a", "a", "b", "b", "a", "b", "a", "b"]
    assert (pair.time_ratio, pair.time_ratio_spread, pair.time_between_s) == (0.5, 0.5, None)
    assert pair.instructions_ratio == 1.0


def test_ratios_are_of_the_same_turn_and_a_difference_lost_in_them_is_not_told() -> None:
    """A machine that is slow in some turns slows both: the ratio has no spread. Noise of either sign is no time."""
    slow = np.array([1.0, 7.0, 2.0, 9.0])

    def compared(times: np.ndarray) -> ABComparison:
        versions = (Version(name, 1, times=tuple(x.tolist())) for name, x in (("a", times), ("b", slow)))
        return ABComparison("algorithms", "sum", "state", *versions)

    found = compared(3 * slow)
    assert (found.time_ratio, found.time_ratio_spread, found.time_between_s) == (3.0, 0.0, 2 * slow.min())
    noise = compared(slow + np.array([0.1, -0.1, 0.2, -0.2]))
    assert noise.time_between_s is None and noise.within_noise
    ((*_, shown),) = cost_rows(rd.accuracy.Cost("arm", (), (noise,), (), {}, 1.0, 1.0))
    assert shown.endswith(", within noise")


def test_json_and_rows_hold_the_alternatives() -> None:
    result = rd.accuracy.cost(setup(FRICTION, controller=CONTROLLERS["sampled"]), budget_s=0.5, repeats=2)
    read = json.loads(json_text(result))
    kept = result.alternatives
    names = ("group", "name", "per", "instructions_ratio", "time_ratio", "time_ratio_spread", "time_between_s")
    of_one = ("name", "instructions", "time_s", "repeats", "repeatable")
    rows = list(result.rows)
    assert len(read["alternatives"]) == len(rows) == len(kept) and any(pair.first.times for pair in kept)
    for told, row, pair in zip(read["alternatives"], rows, kept, strict=True):
        for name in names:
            assert told[name] == row[name] == getattr(pair, name)
        for of, version in (("first", pair.first), ("second", pair.second)):
            for name in of_one:
                known = getattr(version, name) if version.times or name != "time_s" else None
                assert told[of][name] == row[f"{of}_{name}"] == known
    assert read["sentence"] == result.sentence and read["parts"] == result.parts
    assert kept[0].time_ratio is not None


def test_a_time_that_was_not_measured_is_an_empty_cell(tmp_path) -> None:
    result = rd.accuracy.cost(setup(FRICTION), **TINY)
    with result.save(tmp_path / "cost.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert rows and all(row["first_time_s"] == row["second_time_s"] == "" for row in rows)


def test_no_label_of_a_bar_is_over_the_names_of_the_rows() -> None:
    """Labels are right of 0, and right of 1 where bars are of ratios, however far bars go to the left."""

    def compared(group: str, what: str, first: int, second: int) -> ABComparison:
        versions = (Version(str(n), n, times=(float(n),) * 3) for n in (first, second))
        return ABComparison(group, what, "step", *versions)

    pairs = (compared("parts", "wind", 40, 300), compared("parts", step_cost.EVERYTHING, 400, 300))
    result = rd.accuracy.Cost("arm", (), (*pairs, compared("algorithms", "sum", 10, 90)), (), {}, 1.0, 1.0)
    parts, ratios = draw(result).axes
    for axes, least in ((parts, 0), (ratios, 1)):
        assert min(bar.get_x() + min(bar.get_width(), 0) for bar in axes.patches) < least
        assert axes.texts and all(text.get_position()[0] >= least for text in axes.texts)
