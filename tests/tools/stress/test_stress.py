"""The stress test of an arm: what it finds is worse than random, limits hold in runs, and can be repeated."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from itertools import count, islice
from math import isfinite

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.accuracy import random_states
from robot_dyn.integrate import FIXED_STEP
from robot_dyn.report import Budget
from robot_dyn.simulation import Ending
from robot_dyn.tools.stress import limits, runs
from robot_dyn.tools.stress.result import JudgedRun, WorstCase
from robot_dyn.tools.stress.runs import FAMILIES, scenes
from robot_dyn.tools.stress.work import Work
from robot_dyn.tools.stress.worst import BY_PD, FASTEST, pd_gains, shrunk, worst, worst_configurations
from tests.command import run
from tests.hostile.kinds import AXIS, LIMIT
from tests.hostile.kinds import arm as altered
from tests.long import long, stress
from tests.promised import check_document
from tests.short_stress import short_stress

ARMS = ["pendulum", *long(["mimic_chain"]), *stress(["planar_2r", "cart_pole", "ur5"])]
FOREVER = 1e9  # [s]: what is found is not to depend on the load of the machine


@cache
def made(name: str) -> rd.tools.stress.Stress:
    return rd.tools.stress.stress(rd.load(name), samples=300, runs=1, seed=2, budget_s=FOREVER)


@pytest.mark.parametrize("name", ARMS)
def test_what_is_found_is_worst_is_confirmed_and_can_be_repeated(name: str) -> None:
    """In one test, so that one worker searches."""
    searched_states_are_no_better_than_random_ones_and_shrunk_ones_keep_nine_tenths(name)
    each_limit_is_confirmed_or_said(name)
    states_repeat_the_worst_that_was_found(name)
    setups_repeat_what_confirmed_a_limit(name)


def searched_states_are_no_better_than_random_ones_and_shrunk_ones_keep_nine_tenths(name: str) -> None:
    found = made(name).worst
    assert {"κ of M", "fastest motion"} <= {each.quantity for each in found}
    for each in found:
        assert each.searched >= each.random >= each.typical
        assert each.minimal >= 0.9 * each.searched or each.searched < 0


def test_a_state_that_cannot_be_judged_while_shrinking_does_not_lose_the_worst_one() -> None:
    """A measure without a value where an entry is 0, the first that shrinking tries."""
    errors = iter(
        [np.linalg.LinAlgError("singular"), FloatingPointError("overflow"), *[rd.RobotDynError("none")] * 400]
    )

    def measure(batch: dict[str, np.ndarray]) -> np.ndarray:
        if (batch["q"] == 0).any():
            raise next(errors)
        return 3 - ((batch["q"] - 0.5) ** 2).sum(axis=1)  # largest within the range of the random states

    rng, work = np.random.default_rng(4), Work()
    states = {"q": rng.uniform(-1, 1, (100, 3))}
    found = work.do("worst x", partial(worst, WorstCase("x"), states, rng, ("q",), measure))
    assert work.left_out == [] and found is not None
    assert 0 not in found.state["q"] and found.minimal >= 0.9 * found.searched > 0


def test_condition_of_a_double_pendulum_is_worst_where_it_is_straight() -> None:
    """M₁₁ is largest at q₂ = 0, and κ of M scaled to a unit diagonal with the correlation M₁₂/√(M₁₁ M₂₂)."""
    robot, rng = rd.load("planar_2r"), np.random.default_rng(2)
    first = next(worst_configurations(robot, random_states(robot, 300, rng), rng, None, Work()))
    q = np.linspace(-np.pi, np.pi, 721)
    M = robot.M(np.stack([0 * q, q], axis=1))
    r = np.abs(M[:, 0, 1]) / np.sqrt(M[:, 0, 0] * M[:, 1, 1])
    assert first.quantity == "κ of M"
    assert first.searched == pytest.approx(((1 + r) / (1 - r)).max(), rel=1e-9)


def test_largest_payload_of_a_pole_is_that_of_statics() -> None:
    """A level bar of 2 kg and 0.8 m on an effort limit of 30 N m bears m at its end: (2 · 0.4 + m · 0.8) g = 30."""
    text = """<robot name="bar"><link name="base"/><link name="bar"><inertial><origin xyz="0.4 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link><link name="end"/>
    <joint name="hinge" type="revolute"><parent link="base"/><child link="bar"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="30" velocity="2"/></joint>
    <joint name="tip" type="fixed"><parent link="bar"/><child link="end"/><origin xyz="0.8 0 0"/></joint></robot>"""
    robot, rng = rd.Robot.from_text(text), np.random.default_rng(0)
    payload = limits.payload_limit(robot, random_states(robot, 300, rng), rng, (np.ones(1), np.ones(1)), Budget())
    assert payload.value == pytest.approx((30 / 9.80665 - 0.8) / 0.8, rel=1e-6)
    assert payload.confirmed and payload.joint == "hinge" and payload.description.endswith("end")


def each_limit_is_confirmed_or_said(name: str) -> None:
    result = made(name)
    assert {each.kind for each in result.limits} == {"step", "gain", "speed", "payload"}
    assert result.failures == () and result.ok
    of_steps = [each for each in result.limits if each.kind == "step"]
    assert {each.description for each in of_steps if each.confirmed} >= {"Euler", "Midpoint", "RK4", "DP8"}
    assert all("iteration of its stages" in each.description for each in of_steps if not each.confirmed)


def test_a_limit_that_is_too_long_is_refuted(monkeypatch) -> None:
    """Steps 1.1 times as long as the advisor allows leave the equilibrium within the limit already."""
    advise = limits.advice_about

    def wrong(*arguments, **options):
        advice = advise(*arguments, **options)
        return replace(advice, limits={name: 1.1 * x for name, x in advice.limits.items()})

    monkeypatch.setattr(limits, "advice_about", wrong)
    result = rd.tools.stress.stress(rd.load("pendulum"), samples=200, runs=0, budget_s=FOREVER)
    refuted = {each.description for each in result.limits if each.confirmed is False}
    assert {"Euler", "Midpoint", "RK4", "DP8"} <= refuted
    assert not result.ok and len(result.failures) == len(refuted) and "is refuted" in result.failures[0]


def test_an_estimate_that_is_too_small_misleads_and_shrinks_to_a_start_of_few_digits(monkeypatch) -> None:
    """An estimate divided by 100."""
    simulate = runs.simulate

    def boastful(*arguments, **options):
        run = simulate(*arguments, **options)
        if run.error is None:
            return run
        return replace(run, error=replace(run.error, error=run.error.error / 100))

    monkeypatch.setattr(runs, "simulate", boastful)
    robot = rd.load("planar_2r")
    setup = rd.Setup(
        rd.Plant(robot), [0.7312, -0.4321], [0.5111, 0.7222], 0.2, method="Midpoint", step_s=2e-3,
        record_every_s=0.02,
    )  # fmt: skip
    found = runs.compared_run(setup, "swing", Budget())
    assert found.misleads and found.estimated < 0.3 * found.true
    assert runs.compared_run(replace(setup, method="DP8"), "swing", Budget()).misleads is False  # rounding
    small = runs.shrunk_run(found, "shrinking", Work())
    start = [*small.setup.q0.tolist(), *small.setup.v0.tolist()]
    assert small.misleads and sum(map(len, map(repr, start))) < len("0.7312-0.43210.51110.7222")


def test_runs_of_all_families_are_judged_and_say_what_is_true() -> None:
    robot, rng = rd.load("cart_pole"), np.random.default_rng(1)
    states = {"q": np.array([robot.random_configuration(rng) for _ in range(200)])}
    work = Work()
    found = list(filter(None, runs.judged_runs(robot, states, len(FAMILIES), rng, work)))
    assert len(found) + len(work.left_out) == len(FAMILIES)
    assert len(found) >= len(FAMILIES) - 1 and not any(each.misleads for each in found)
    assert sum(isfinite(each.true) for each in found) >= len(FAMILIES) - 2


def states_repeat_the_worst_that_was_found(name: str) -> None:
    """By public queries of the robot, its certificate, and the advisor."""
    result, robot = made(name), rd.load(name)
    for each in result.worst:
        state = {key: np.array(x) for key, x in each.state.items()}
        if each.quantity == "κ of M":
            M = robot.M(state["q"])
            d = np.sqrt(np.diagonal(M))
            assert np.linalg.cond(M / np.outer(d, d)) == pytest.approx(each.minimal, rel=1e-9)
        elif each.quantity.startswith("gravity"):
            i = robot.joint_names.index(each.joint)
            assert abs(robot.N(state["q"])[i]) / robot.effort_limit[i] == pytest.approx(each.minimal, rel=1e-9)
        elif each.quantity == FASTEST:  # the advisor's, to two digits, where gravity is balanced
            gains = (0.0, 0.0) if each.note != BY_PD else pd_of(result)
            effects = () if each.note == BY_PD else "urdf"
            held = rd.control.PDGravity(robot, rd.control.hold(state["q"]), kp=gains[0], kd=gains[1])
            setup = rd.Setup(rd.Plant(robot, effects), state["q"], controller=held, duration_s=1e-4)
            assert abs(rd.advise(setup).fastest.eigenvalue) == pytest.approx(each.minimal, rel=0.06)
        elif each.note.startswith("Pinocchio"):
            again = rd.accuracy.certify(robot, **state, samples=100, repeats=1).digits_of(
                each.quantity.split()[-1], "Pinocchio"
            )
            rough = 0.1 if "inverse" in each.quantity else 1e-9  # on the root mean square of 100 states
            assert -np.log10(2.0**-53) - again.at_state == pytest.approx(each.minimal, rel=rough)


def pd_of(result: rd.tools.stress.Stress) -> tuple[np.ndarray, np.ndarray]:
    """Gains of the PD by which steps are judged."""
    law = next(each.setups[0].controller for each in result.limits if each.kind == "step" and each.description == "RK4")
    return law.kp, law.kd


def setups_repeat_what_confirmed_a_limit(name: str) -> None:
    """The run within a limit stays where the one beyond it goes, ten times as far or more."""
    confirmed = [each for each in made(name).limits if each.confirmed and len(each.setups) == 2]
    confirmed = list({each.kind: each for each in confirmed}.values())  # of steps one method
    assert {each.kind for each in confirmed} >= {"step", "gain"}
    for each in confirmed:
        within, beyond = (rd.simulate(setup) for setup in each.setups)
        off = [np.nanmax(np.abs(run.q[len(run.t) // 2 :] - each.state["q"])) for run in (within, beyond)]
        assert beyond.outcome.ending is Ending.DIVERGED or off[1] > (2 if each.kind == "payload" else 10) * off[0], each


def test_a_joint_without_inertia_is_named_and_the_rest_is_told() -> None:
    with pytest.warns(rd.ModelWarning, match="has no mass"):
        robot = rd.load("massless_tip")
    result = rd.tools.stress.stress(robot, samples=100, runs=1, budget_s=FOREVER)
    assert "runs: joint 'pointer_joint' carries no inertia" in result.left_out
    assert {each.kind for each in result.limits} == {"speed", "payload"} and not result.runs
    assert {each.quantity for each in result.worst} == {
        "gravity torque / effort limit",
        "digits lost in inverse_dynamics",
    }


def test_numbers_beyond_a_float64_are_left_out_by_name() -> None:
    """|N| over a limit of 1e-320 N m, of the joint that gravity turns; and a measure without a value anywhere."""
    text = altered((LIMIT, LIMIT.replace('effort="9"', 'effort="1e-320"')), (AXIS, '<axis xyz="0 1 0"/>'))
    robot, rng, work = rd.Robot.from_text(text), np.random.default_rng(3), Work()
    states = random_states(robot, 100, rng)
    assert {each.quantity for each in worst_configurations(robot, states, rng, None, work)} == {"κ of M", FASTEST}
    nowhere = partial(worst, WorstCase("nothing"), states, rng, ("q",), lambda batch: np.full(len(batch["q"]), np.nan))
    assert work.do("nothing", nowhere) is None
    assert [each.partition(": ")[0] for each in work.left_out] == [
        "worst gravity torque / effort limit, shoulder",
        "nothing",
    ]
    assert work.left_out[0].endswith("numbers exceed the range of float64")


def test_joints_without_limits_are_named() -> None:
    report = made("pendulum").left_out
    assert "joints without an effort limit: pivot" in report
    assert any(each.startswith("joints without a velocity limit: pivot") for each in report)


def test_what_is_found_depends_on_the_seed_alone() -> None:
    robot = rd.load("cart_pole")

    def found(seed: int) -> list[object]:
        rng = np.random.default_rng(seed)
        states = random_states(robot, 200, rng)
        worst = list(worst_configurations(robot, states, rng, None, Work()))
        return [*worst, *(repr(make()[0]) for make in scenes(robot, states, 7, rng))]

    assert found(3) == found(3) != found(4)


def ticking(step: int = 1) -> Callable[[], float]:
    """A clock that goes on whenever it is looked at."""
    clock = count(0, step)
    return lambda: float(next(clock))


@pytest.mark.parametrize("looks", [1, 100, *long([1000])])
def test_what_there_is_no_time_for_is_named_and_nothing_else_is_missing(looks: int) -> None:
    """Each method of fixed step is a limit or a name, and so are gain, speed and payload."""
    result = short_stress(rd.load("planar_2r"), looks, 2)
    late = " ".join(result.out_of_time)
    assert late
    if "random states" in late:
        assert result.out_of_time == ("random states", "all at these") and not result.worst
        return
    found = {each.description.split(",")[0] for each in result.limits if each.kind == "step"}
    for name in FIXED_STEP:
        assert (name in found) != (f"step of {name}" in late or "steps" in result.out_of_time)
    for of in ("gain", "speed", "payload"):
        assert (of in {each.kind for each in result.limits}) != (of in late)
    assert f"{len(result.out_of_time)} not finished in time" in result.sentence
    assert f"not finished in time: {result.out_of_time[0]}" in result.blocks()


def test_a_budget_looks_at_the_clock_within_each_piece() -> None:
    """So many looks, and few more: at most one for each name that is left."""
    looks = count()
    robot = rd.load("planar_2r")
    short_stress(robot, 500, 7, 2, lambda: float(next(looks)))
    assert next(looks) < 500 + 200


def test_with_time_enough_what_is_found_depends_on_no_clock() -> None:
    """By one that stands still, and by one that is 1000 s further at each look."""
    robot, found = rd.load("planar_2r"), []
    for clock in (ticking(1000), lambda: 0.0):
        rng, work = np.random.default_rng(5), Work(Budget(1e12, clock=clock), 1e11)
        states = random_states(robot, 100, rng)
        worst = list(worst_configurations(robot, states, rng, pd_gains(robot, states), work))
        told = [f"{each} {each.setup}" for each in filter(None, runs.judged_runs(robot, states, 2, rng, work))]
        found.append((worst, told, work.left_out))
        assert work.out_of_time == []
    assert found[0] == found[1]


def test_a_run_ends_at_its_deadline_and_so_do_the_companions_of_its_error_estimate() -> None:
    """They take more steps than the run: the clock stops them beyond its 100 steps, and before their end."""
    setup = rd.Setup(rd.Plant(rd.load("pendulum")), [0.4], duration_s=0.1, method="RK4", engine="interpreted")
    for most, done in ((50, False), (150, False), (1e6, True)):
        work = Work(Budget(most, clock=ticking()))
        run = work.do("run", lambda until: rd.simulate(setup, on_progress=until.check))
        assert (run is not None) == done and work.out_of_time == ([] if done else ["run"])


@pytest.mark.parametrize("judgements", [1, 3])
def test_shrinking_that_has_no_time_keeps_the_smallest_failure_so_far(monkeypatch, judgements: int) -> None:
    """It is the run as it was found if no other was judged."""
    robot, rng, told = rd.load("pendulum"), np.random.default_rng(1), list[JudgedRun]()

    def judged(setup: rd.Setup, what: str, budget: Budget) -> JudgedRun:
        while len(told) == judgements:
            budget.check()
        told.append(JudgedRun(what, 0.1, 1e-9, 1.0, 0.0, "", True, setup))
        return told[-1]

    monkeypatch.setattr(runs, "compared_run", judged)
    work = Work(Budget(10, clock=ticking()))
    assert list(runs.judged_runs(robot, random_states(robot, 100, rng), 1, rng, work)) == told[-1:]
    assert work.out_of_time == ["shrinking of run 1"]


def test_friction_that_is_faster_than_all_else_is_what_the_push_is_along() -> None:
    """A joint whose friction decays within a microsecond: the push grows along its velocity, or no step is refuted."""
    text = """<robot name="finger"><link name="base"/><link name="tip"><inertial><origin xyz="0.02 0 0"/>
    <mass value="0.01"/><inertia ixx="1e-6" ixy="0" ixz="0" iyy="1e-6" iyz="0" izz="1e-6"/></inertial></link>
    <joint name="hinge" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="5"/><dynamics damping="5"/></joint></robot>"""
    robot = rd.Robot.from_text(text)
    setup = limits.holding_setup(robot, np.array([0.3]), (np.array([2e-3]), np.array([2e-4])), 40.0)
    found = {
        each.description: each for each in islice(filter(None, limits.step_limits(setup, 0, Work())), 4)
    }  # the explicit ones
    assert found["Euler"].value == pytest.approx(2 * robot.M(np.array([0.3]))[0, 0] / 5, rel=0.01)
    assert all(each.confirmed for each in found.values())


def test_a_run_that_leaves_an_equilibrium_is_seen_to_say_so() -> None:
    """Steps beyond their limit: the run leaves the equilibrium, and admits that."""
    robot = rd.load("pendulum")
    law = rd.control.PDGravity(robot, rd.control.hold([0.4]), kp=133.0, kd=13.3)
    setup = rd.Setup(rd.Plant(robot), [0.4 + 1e-6], duration_s=2.0, controller=law, method="Midpoint", step_s=0.11)
    pushed = limits.run_from_near(setup, np.array([0.4]), Budget(), True)
    assert pushed.growth > 30 and not pushed.misleads  # it says so


# --- shrinking: the property stays, and fewer entries and digits are left ----------------------------------------

STATE = np.array([0.73125, -1.9371, 0.00123456, 2.718281828, -0.4])


def test_entries_that_do_not_matter_become_zero_and_the_others_get_few_digits() -> None:
    """x₃ > 2.5 holds at 3 alone, the one-digit number nearest to it."""
    np.testing.assert_array_equal(shrunk(STATE, lambda x: x[3] > 2.5), [0, 0, 0, 3, 0])


def test_digits_that_matter_are_kept() -> None:
    """|x₁ + 1.9371| < 1e-4 takes five digits; x₀ ≥ 0.7 one."""
    small = shrunk(STATE, lambda x: abs(x[1] + 1.9371) < 1e-5 and x[0] >= 0.7)
    np.testing.assert_array_equal(small, [0.7, -1.9371, 0, 0, 0])


@pytest.mark.parametrize("seed", range(20))
def test_what_is_given_back_has_the_property_and_no_entry_that_could_be_zero(seed: int) -> None:
    """Of a property of sums, in which entries stand in for each other."""
    rng = np.random.default_rng(seed)
    x, weights = rng.normal(size=8), rng.normal(size=8)
    level = float(x @ weights - 0.1 * abs(x @ weights))

    def fails(y: np.ndarray) -> bool:
        return bool(y @ weights >= level)

    small = shrunk(x, fails)
    assert fails(small)
    assert np.count_nonzero(small) <= np.count_nonzero(x)
    for k in np.flatnonzero(small):
        young = small.copy()
        young[k] = 0.0
        assert not fails(young)


def test_a_state_without_the_property_comes_back_as_it_is_and_tries_are_counted() -> None:
    np.testing.assert_array_equal(shrunk(STATE, lambda x: False), STATE)
    calls = []
    shrunk(STATE, lambda x: bool(calls.append(1)) or (x[0] > 0.7 and x[3] > 2.7), most=7)
    assert len(calls) == 7


# --- the command ------------------------------------------------------------------------------------------------


def test_document_has_the_keys_that_are_promised_and_no_infinity(tmp_path, monkeypatch) -> None:
    whole = made("pendulum")
    monkeypatch.setattr(rd.tools.stress, "stress", lambda *arguments, **options: whole)
    done = run("stress", "pendulum", "--json", "-o", tmp_path / "found")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    check_document("stress", document)
    assert all(document[part] for part in ("worst", "limits", "runs"))
    text = (tmp_path / "found.json").read_text(encoding="utf-8")
    assert json.loads(text) == document and str(tmp_path) not in text
    shown = run("stress", "pendulum")
    assert shown.returncode == 0 and shown.stdout.startswith("pendulum: no failures in ")


def test_failures_are_told_loudly(monkeypatch) -> None:
    whole = made("pendulum")
    wrong = replace(whole, limits=tuple(replace(each, confirmed=False) for each in whole.limits[-1:]))
    monkeypatch.setattr(rd.tools.stress, "stress", lambda *arguments, **options: wrong)
    done = run("stress", "pendulum")
    assert done.returncode == 1 and "\nFAILURE: gain PD" in done.stdout
