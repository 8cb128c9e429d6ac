"""Rollouts: each run of a batch is the run that it is by itself, whatever the others do and whoever does it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.effects import Active
from robot_dyn.foundations import QueryError, TraceError
from robot_dyn.simulation.rollouts import pool
from tests.command import refusal, said
from tests.long import long

ARM = rd.load("planar_2r")
Q, V = np.array([0.4, -0.7]), np.array([0.3, 0.5])
REFERENCE = rd.control.quintic(Q, Q + 0.5, 0.1, start_s=0.05)
PLANT = rd.Plant(
    ARM,
    [
        rd.effects.ViscousFriction([0.3, 0.1]),
        rd.effects.RegularisedCoulombFriction(0.2, 0.1),
        rd.effects.EffortLimit(30.0),
    ],
)
SETUP = rd.Setup(
    PLANT,
    Q,
    V,
    0.2,
    rd.control.PD(REFERENCE, kp=40.0, kd=[4.0, 3.0]),
    method="RK4",
    step_s=2e-3,
    record_every_s=0.01,
)

PID = replace(SETUP, controller=rd.control.PID(REFERENCE, kp=40.0, ki=30.0, kd=4.0, effort_limit=3.0, period_s=0.004))
ARM_TIP, INERTIA = "tip", ((0.01, 0.0, 0.0), (0.0, 0.02, 0.001), (0.0, 0.001, 0.03))
NOMINAL = ARM.with_(payload=rd.Payload(ARM_TIP, 1.0))
EVERYTHING = ("q", "v", "u", "energy", "work")


def starts(count: int, spread: float = 0.3) -> np.ndarray:
    return Q + spread * np.random.default_rng(3).normal(size=(count, 2))


def arrays(runs: rd.Rollouts) -> list[np.ndarray]:
    """All arrays of numbers of a batch, by run."""
    given = [runs.q, runs.v, runs.u, runs.kinetic, runs.potential, *(runs.work or {}).values(), runs.ended_s]
    return [x for x in given if x is not None]


def loaded(mass: float = 1.0, **edits: Any) -> rd.Robot:
    return ARM.with_(payload=rd.Payload(ARM_TIP, mass, (0.05, 0.02, 0.0), INERTIA), **edits)


def batches() -> dict[str, tuple[rd.Setup, dict[str, Any]]]:
    """Setups with the starts and the values of their runs."""
    rng, free = np.random.default_rng(5), replace(SETUP, plant=rd.Plant(loaded()), controller=None)
    weightless, far = ARM.with_(gravity=(0.0, 0.0, 0.0)), starts(3)
    far[1] = 2e5, 0.3  # [rad]: the sine of a tile is no longer exact there, and the run is made alone
    gains = {"kp": rng.uniform(20, 60, 5), "kd": rng.uniform(2, 5, (5, 2))}
    gains |= {"viscous_friction.viscous": rng.uniform(0, 1, (5, 2)), "effort_limit.limit": rng.uniform(5, 30, 5)}
    masses = {f"payload_mass:{ARM_TIP}": rng.uniform(0, 3, 70), "viscous_friction.viscous": rng.uniform(0, 1, 70)}
    known = rd.control.PDGravity(NOMINAL, REFERENCE, kp=40.0, kd=4.0)
    stops = rd.effects.joint_stops([-1.0, -1.0], [0.4, 1.0], 0.0, 0.0)
    levels = {"joint_stops.stiffness": [0.0, 1e4, 1e4], "joint_stops.upper": [[0.5, 1.0], [0.5, 1.0], [0.45, 0.6]]}
    walls = {"joint_stops.upper": [[0.4, 1.0], [0.3, 0.8], [0.35, 0.9]], "kp": [20.0, 30.0, 40.0]}
    hard = rd.Plant(ARM, [rd.effects.ViscousFriction(0.5), *rd.effects.joint_stops([-1.0, -1.0], [0.4, 1.0], 1e4)])
    chosen = {"method": rd.integrate.Adaptive(), "step_s": None, "record_every_s": 0.05, "engine": "compiled"}
    body = rd.effects.CarriedPayload(rd.Payload(ARM_TIP, 0.7), 0.05, 0.12)
    resting = rd.effects.LuGreFriction(1.0, 1.0, 0.1, 0.2, 0.3, 0.1)  # pushed away from v = 0: no reversal
    push = rd.control.PD(rd.control.hold(Q + 3.0), kp=[20.0, 0.8], kd=0.0)
    bristles = rd.effects.LuGreFriction(100.0, 1.0, 0.05, 0.2, 0.3, 0.05)  # steps in (q, p) end nowhere for them
    odd = {"duration_s": 0.123, "record_every_s": 0.0101}  # the run does not hold it a whole number of times
    gauss = rd.integrate.method("GaussLegendre4")
    return {
        "one": (SETUP, {"q0": starts(1)}),
        "a tile and a bit more": (SETUP, {"q0": starts(70)}),
        "sampled": (PID, {"q0": starts(70)}),
        "far": (free, {"q0": far, "vary": {f"payload_mass:{ARM_TIP}": [0.5, 1.5, 2.5]}}),
        "gains and friction": (SETUP, {"vary": gains}),
        "masses": (replace(SETUP, plant=rd.Plant(loaded(), PLANT.effects)), {"vary": masses}),
        "masses unknown to the model": (
            replace(SETUP, plant=rd.Plant(loaded(), PLANT.effects), controller=known), {"vary": masses},
        ),
        "levels": (
            rd.Setup(rd.Plant(weightless, stops), Q, V, 0.5, method="RK4", record_every_s=0.1), {"vary": levels},
        ),
        "chosen steps": (replace(SETUP, plant=hard, **chosen), {"q0": starts(3), "vary": walls}),
        "payloads come and go": (
            replace(SETUP, plant=rd.Plant(ARM, [body]), controller=None),
            {"vary": {"gravity": [[0.0, 0.0, -9.8], [1.0, 0.0, -1.6]]}},
        ),
        "bristles": (
            rd.Setup(rd.Plant(weightless, [resting]), Q, None, 0.2, push, method="RK4"), {"q0": starts(3, 0.01)},
        ),
        "tons": (rd.Setup(rd.Plant(ARM.with_(mass_scale=2000.0)), [1.5, 0.2], duration_s=0.2, method="RK4"), {}),
        **{f"every {x} s": (replace(SETUP, record_every_s=x), {"q0": starts(2)}) for x in (0.0, 0.005, 0.03, 0.5)},
        "between cut steps": (replace(SETUP, **odd), {"q0": starts(2)}),
        "between steps": (replace(SETUP, plant=rd.Plant(ARM, PLANT.effects[:2]), **odd), {"q0": starts(2)}),
        "between steps in (q, p)": (
            replace(SETUP, plant=rd.Plant(ARM, [bristles]), method=gauss, **odd), {"q0": starts(2)},
        ),
        "GaussLegendre": (replace(SETUP, method=rd.integrate.method("GaussLegendre2")), {"q0": starts(70)}),
    }  # fmt: skip


@pytest.mark.parametrize("name", [*(name for name in batches() if name != "GaussLegendre"), *long(["GaussLegendre"])])
def test_each_run_is_that_of_simulate(name: str) -> None:
    """To rounding: samples, energies, works and outcome; run i of the batch is that of `setup_of(i)`."""
    setup, given = batches()[name]
    runs = rd.rollouts(setup, record=EVERYTHING, **given)
    atol = 1e-8 if name == "far" else 1e-12  # 1 ulp of 2e5 rad is 3e-11
    for i in {0, len(runs) // 2, len(runs) - 1}:
        alone = rd.simulate(runs.setup_of(i), estimate_error=False)
        m = len(alone.t)
        np.testing.assert_allclose(runs.t[:m], alone.t, rtol=1e-15)
        pairs = [(runs.q, alone.q), (runs.v, alone.v), (runs.u, alone.u)]
        pairs += [(runs.kinetic, alone.ledger.kinetic), (runs.potential, alone.ledger.potential)]
        pairs += [(runs.work[source], work) for source, work in alone.ledger.work.items()]
        for ours, theirs in pairs:
            np.testing.assert_allclose(ours[i][:m], theirs, rtol=0, atol=atol * (1 + np.abs(theirs).max()))
            assert np.isnan(ours[i][m:]).all()
        assert runs.outcome(i) == alone.outcome
        assert (runs.outcome(i).ending == "diverged") is (name == "between steps in (q, p)")
    assert name != "bristles" or "repeated" not in runs.statistics.engine
    assert name != "chosen steps" or "one after the other" in runs.statistics.engine


def test_the_setup_of_a_run_has_its_values() -> None:
    """Gains, coefficients of effects, levels, gravity and masses; the model of a controller keeps its own."""
    for name, parts in {
        "gains and friction": lambda x: {
            "kp": x.controller.kp, "kd": x.controller.kd, "viscous_friction.viscous": x.plant.effects[0].viscous,
            "effort_limit.limit": x.plant.effects[2].limit,
        },
        "masses unknown to the model": lambda x: {
            f"payload_mass:{ARM_TIP}": x.plant.dynamics.edits.payloads[0].mass,
            "viscous_friction.viscous": x.plant.effects[0].viscous,
        },
        "chosen steps": lambda x: {"kp": x.controller.kp, "joint_stops.upper": x.plant.effects[1].upper},
        "levels": lambda x: {
            "joint_stops.stiffness": x.plant.effects[0].stiffness, "joint_stops.upper": x.plant.effects[0].upper,
        },
        "payloads come and go": lambda x: {"gravity": x.plant.dynamics.edits.gravity},
    }.items():  # fmt: skip
        setup, given = batches()[name]
        runs = rd.rollouts(setup, record=(), **given)
        for i in range(len(runs)):
            own = runs.setup_of(i)
            for key, value in parts(own).items():
                np.testing.assert_array_equal(value, np.broadcast_to(given["vary"][key][i], np.shape(value)))
            assert not name.endswith("model") or own.controller.model == NOMINAL


def test_threads_change_nothing() -> None:
    """150 runs are three tiles: bit for bit the same from one thread, from two and from three."""
    q0 = starts(150)
    first = rd.rollouts(SETUP, q0, record=EVERYTHING, threads=1)
    for threads in (2, 3):
        for x, y in zip(arrays(first), arrays(rd.rollouts(SETUP, q0, record=EVERYTHING, threads=threads)), strict=True):
            np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("effects", [PLANT.effects, PLANT.effects[:2]])
@pytest.mark.parametrize("method", ["RK4", *long(["GaussLegendre2"])])
def test_a_run_that_diverges_leaves_the_others_as_they_are(method: str, effects: list[Any]) -> None:
    """Bit for bit; its own samples are those of simulate up to its end, then nan.

    It names its time and reason as simulate does; before its step is judged, the joint that moved fastest.
    """
    plant = rd.Plant(ARM, effects)
    setup = replace(SETUP, plant=plant, method=rd.integrate.method(method), record_every_s=0.0)
    q0, v0 = starts(40), np.broadcast_to(V, (40, 2)).copy()
    wild = [3, 17]
    quiet = rd.rollouts(setup, q0, v0, record=EVERYTHING)
    v0[wild] = [[1e5, 3e7], [3e7, 1e4]]
    runs = rd.rollouts(setup, q0, v0, record=EVERYTHING)
    others = np.setdiff1d(np.arange(40), wild)
    np.testing.assert_array_equal(runs.q[others], quiet.q[others])
    np.testing.assert_array_equal(runs.v[others], quiet.v[others])
    assert sorted(np.flatnonzero(runs.diverged)) == wild and not quiet.diverged.any()
    for i in wild:
        alone, outcome = rd.simulate(setup, q0=q0[i], v0=v0[i], estimate_error=False), runs.outcome(i)
        assert alone.outcome.ending == outcome.ending == "diverged" and runs[i].outcome == outcome
        assert runs.ended_s[i] == pytest.approx(alone.outcome.t, abs=0.01)
        later = runs.t > runs.ended_s[i] + 1e-9
        assert later.any() and np.isnan(runs.q[i, later]).all() and np.isnan(runs.u[i, later]).all()
        assert np.isnan(runs.kinetic[i, later]).all() and np.isfinite(runs[i].q).all()
        assert runs.ended_s[i] < 0.2 and "step" in outcome.text
        assert (outcome.reason, outcome.joint) == (alone.outcome.reason, alone.outcome.joint)
        if len(effects) == 2:  # nothing cuts their steps
            assert runs.ends[i].joint == ARM.joint_names[np.argmax(np.abs(runs[i].v[-1]))]
            assert runs.ends[i].facts == {"step_s": pytest.approx(0.002)}
    assert "2 diverged" in runs.summary and f"run 3 diverged at t = {runs.ended_s[3]:g} s; " in runs.summary
    assert not runs.outcome(0).text


@pytest.mark.parametrize("engine", ["interpreted", "compiled"])
def test_a_run_that_overflows_ends_at_the_step_at_which_simulate_ends_it(engine: str) -> None:
    """Velocities square from step to step: from 1e100 to 1e308 it is one or two of them. Rounding moves no end."""
    rng, h = np.random.default_rng(2), 0.02
    q0, v0 = rng.normal(size=(12, 2)), 30.0 * rng.normal(size=(12, 2))
    setup = rd.Setup(SETUP.plant, q0[0], v0[0], duration_s=40 * h, method="Euler", step_s=h, engine=engine)
    runs = rd.rollouts(replace(setup, engine="auto"), q0, v0)
    wild = np.flatnonzero(runs.diverged)
    assert len(set(np.rint(runs.ended_s[wild] / h))) > 2
    for i in wild:
        alone = rd.simulate(setup, q0=q0[i], v0=v0[i], estimate_error=False)
        assert (alone.outcome.ending, alone.outcome.t) == (runs.outcome(i).ending, runs.outcome(i).t)


def test_only_what_is_asked_for_is_recorded() -> None:
    runs = rd.rollouts(SETUP, starts(2), record=["v"])
    assert runs.q is None and runs.u is None and runs.kinetic is None and runs.work is None
    np.testing.assert_array_equal(runs.v, rd.rollouts(SETUP, starts(2)).v)


def assert_alike(ours: np.ndarray, theirs: np.ndarray) -> None:
    """To rounding of what a tile and a single state compute."""
    assert ours.shape == theirs.shape
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-10 * (1 + np.abs(theirs).max()))


@pytest.mark.parametrize("setup", [SETUP, PID, *long([replace(SETUP, method=rd.integrate.method("GaussLegendre2"))])])
@pytest.mark.parametrize("record", [EVERYTHING, ("q", "v")])
def test_a_run_of_a_batch_is_the_trajectory_of_simulate(setup: rd.Setup, record: tuple[str, ...]) -> None:
    """In all that was recorded or follows from it; what neither tells is nan, and nothing is in its place."""
    params = {"viscous_friction.viscous": np.array([[0.3, 0.1], [0.7, 0.2], [0.0, 0.4]])}
    runs = rd.rollouts(setup, starts(3), vary=params, record=record)
    effects = [rd.effects.ViscousFriction(params["viscous_friction.viscous"][-1]), *PLANT.effects[1:]]
    alone = rd.simulate(setup, q0=starts(3)[-1], plant=rd.Plant(ARM, effects), estimate_error=False)
    run = runs[-1]
    for name in ("t", "q", "v", "desired", "tracking_error"):
        assert_alike(getattr(run, name), getattr(alone, name))
    everything, follows = record == EVERYTHING, not setup.controller.state_size
    for ours, theirs, known in (
        (run.u, alone.u, everything or follows),
        (run.a, alone.a, everything or follows),
        (run.power["control"], alone.power["control"], everything or follows),
        (run.power["viscous_friction"], alone.power["viscous_friction"], True),
        (run.ledger.kinetic, alone.ledger.kinetic, True),
        (run.ledger.potential, alone.ledger.potential, True),
        (run.ledger.work["control"], alone.ledger.work["control"], everything),
    ):
        assert_alike(ours, theirs) if known else np.testing.assert_array_equal(ours, np.full_like(theirs, np.nan))
    assert run.power.keys() == alone.power.keys() == run.ledger.work.keys()
    assert run.outcome == alone.outcome and run.statistics.steps == alone.statistics.steps
    assert run.error is None and "not estimated (a run of rollouts)" in run.summary
    assert_alike(run.extremes, alone.extremes)
    assert ("was not recorded" in run.summary) is not everything
    assert {name: run.metadata[name] for name in alone.metadata} == alone.metadata


def test_runs_are_numbered_as_lists_are() -> None:
    runs = rd.rollouts(SETUP, starts(5), vary={"kp": np.arange(5.0)})
    np.testing.assert_array_equal(runs[-2].q, runs.q[3])
    some = runs[1:4]
    assert len(some) == 3 and some.varied["kp"][0, 0] == 1.0 and len(list(runs)) == 5
    np.testing.assert_array_equal(some[0].u, runs[1].u)
    with pytest.raises(IndexError, match="no run 5: runs are numbered from 0 to 4"):
        runs[5]
    with pytest.raises(QueryError, match="no run in"):
        runs[2:2]
    with pytest.raises(QueryError, match="a whole number or a slice"):
        runs["first"]
    with pytest.raises(QueryError, match="a whole number or a slice, got True"):
        runs[True]
    with pytest.raises(QueryError, match="if q and v were recorded"):
        rd.rollouts(SETUP, starts(2), record=["q"])[0]


def test_a_run_of_a_slice_has_the_noise_that_it_had() -> None:
    """Noise is of the number of a run in its batch, whatever its number in a slice, a slice of one, or backwards."""
    loop = rd.control.Loop(rd.control.PD(REFERENCE, kp=40.0, kd=4.0, period_s=4e-3), position=[rd.control.Noise(0.01)])
    runs = rd.rollouts(replace(SETUP, controller=loop), [Q] * 6)
    for some in (runs[2:5], runs[1:][1:4], runs[::-2]):
        for i in range(3):
            alone = rd.simulate(some.setup_of(i), estimate_error=False, engine="compiled")
            np.testing.assert_allclose(alone.q, some.q[i], rtol=0, atol=1e-12)  # other noise moves q by 1e-3


@pytest.mark.parametrize(
    "command", [("replay", "--html", "page.html"), ("diff-runs", "run.npz")], ids=lambda command: command[0]
)
def test_commands_say_what_a_file_of_rollouts_is(command: tuple[str, ...], tmp_path: Path, monkeypatch) -> None:
    """A batch is not reported as damaged; the advised remedy makes a file that they accept."""
    monkeypatch.chdir(tmp_path)
    rd.rollouts(SETUP, starts(3), V).save("runs.npz")
    text = refusal((command[0], "runs.npz", *command[1:]))
    assert "contains 3 runs" in text and "[0].save(" in text
    rd.read("runs.npz")[0].save("run.npz")
    assert said(command[0], "run.npz", *command[1:])


def test_the_command_plot_draws_a_batch(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    rd.rollouts(SETUP, starts(3), V).save("runs.npz")
    assert "written: " in said("plot", "runs.npz", "--only", "fan", "--joint", "joint_1")
    assert (tmp_path / "runs.png").stat().st_size > 1000


@pytest.mark.parametrize("record", [EVERYTHING, ("q", "v"), ("u",)])
def test_rollouts_are_saved_and_read(record: tuple[str, ...], tmp_path: Path) -> None:
    """Bit for bit, and a file that was cut short, or is of another kind, is refused."""
    v0 = np.tile(V, (4, 1))
    v0[2] = 1e5, 3e7
    runs = rd.rollouts(SETUP, starts(4), v0, vary={"kp": np.arange(4.0)}, record=record)
    path = runs.save(tmp_path / "runs")
    back = rd.read(path)
    for x, y in zip(arrays(runs), arrays(back), strict=True):
        np.testing.assert_array_equal(x, y)
    assert back.setup is None and [back.outcome(i) for i in range(4)] == [runs.outcome(i) for i in range(4)]
    assert back.metadata["urdf"] == runs.metadata["urdf"] and back.varied["kp"][3, 0] == 3.0
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(rd.RobotDynError, match="cannot be read as a run file"):
        rd.read(path)
    with pytest.raises(rd.RobotDynError, match=r"there is no such file; write one with run\.save"):
        rd.read(tmp_path / "none.npz")


@pytest.mark.parametrize("read", [False, True])
def test_a_run_of_a_batch_is_saved_drawn_and_replayed(read: bool, tmp_path: Path) -> None:
    """With what it has: torques and energies that nobody recorded are not drawn."""
    runs = rd.rollouts(PID, starts(2))
    runs = rd.read(runs.save(tmp_path / "runs")) if read else runs
    run = runs[1]
    again = rd.read(run.save(tmp_path / "run"))
    np.testing.assert_array_equal(again.q, run.q)
    assert rd.replay(run).save(tmp_path / "run").stat().st_size > 10_000
    assert rd.plot(run).axes
    for name in ("torques", "energy"):
        with pytest.raises(rd.RobotDynError, match="not recorded; add"):
            rd.plot(run, name)


def test_progress_of_a_batch() -> None:
    """Times that grow from the start to the end of the run; what it raises ends the batch."""
    setup, seen = replace(SETUP, duration_s=3.0), []
    rd.rollouts(setup, starts(200), threads=1, on_progress=seen.append)
    assert seen[-1] == 3.0 and seen == sorted(seen) and seen[0] >= 0

    def enough(t: float) -> None:
        raise ValueError("enough")

    with pytest.raises(ValueError, match="enough"):
        rd.rollouts(replace(SETUP, duration_s=100.0), starts(200), threads=1, on_progress=enough)


class Table(Active):
    def torque(self, dynamics, t, q, v):
        return np.array([0.1, 0.2])[int(10 * t) % 2] * v


def test_what_has_no_meaning_is_refused() -> None:
    """Before anything runs: also a coefficient that the effect itself refuses, or one of two effects alike."""
    bad, ones = starts(4), np.ones(3)
    bad[2, 1] = np.nan
    two = rd.Plant(ARM, [rd.effects.ViscousFriction(0.3), rd.effects.ViscousFriction(0.1)])
    for message, options in {
        "q0 must be finite, got nan for joint": {"q0": bad},
        r"q0 must have shape \(2,\)": {"q0": np.zeros((4, 3))},
        "the same number of runs": {"q0": starts(4), "v0": np.zeros((3, 2))},
        r"the same number of runs, .*'kp': \(3,\)": {"q0": starts(4), "vary": {"kp": ones}},
        "the same number of runs, B ≥ 1: ": {"q0": np.zeros((0, 2))},
        r"mass_scale must have shape \(B,\) or \(B, 1\), got \(\)": {"vary": {"mass_scale": 1.1}},
        "no parameter 'kq'; nearest: k": {"vary": {"kq": ones}},
        "no parameter 'viscous_friction.visc'; nearest: viscous_friction.viscous": {
            "vary": {"viscous_friction.visc": ones}
        },
        "kp must not be negative": {"vary": {"kp": [-1.0]}},
        r"no parameter 'payload_mass:elbow': the arm has no payload; add one with robot.with_\(payload=": {
            "vary": {"payload_mass:elbow": ones}
        },
        "velocity_scale": {"vary": {"regularised_coulomb_friction.velocity_scale": np.zeros(2)}},
        r"several effects of the plant; give 'viscous_friction 1\.viscous' and 'visc": {
            "plant": two, "vary": {"viscous_friction.viscous": ones},
        },
        "vary must give values by name, such as": {"vary": [1]},
        "vary must give values by name, .*3": {"vary": {3: ones}},
        "no record 'torque'": {"record": ("torque",)},
        "threads .* must be a whole number, from 1": {"threads": 0},
        r"at most .* samples of 4 runs takes .*e-0\d GiB, more than 9.31e-08 GiB: use a longer record_every_s": {
            "q0": starts(4), "max_bytes": 100,
        },
    }.items():  # fmt: skip
        with pytest.raises(rd.RobotDynError, match=message):
            rd.rollouts(SETUP, **options)
    with pytest.raises(TraceError, match="effect table"):
        rd.rollouts(replace(SETUP, plant=rd.Plant(ARM, [Table()])))


def test_a_batch_of_the_engine_that_is_named_is_that_of_simulate() -> None:
    """Interpreted, to the last bit; also of a part that cannot be compiled."""
    for effects in (PLANT.effects, [Table()]):
        setup = replace(SETUP, plant=rd.Plant(ARM, effects), engine="interpreted", estimate_error=False)
        runs = rd.rollouts(setup, starts(2), vary={"kp": [40.0, 30.0]}, record=("q", "u"))
        alone = rd.simulate(setup, q0=starts(2)[1], controller=replace(setup.controller, kp=30.0))
        np.testing.assert_array_equal(runs.q[1], alone.q)
        np.testing.assert_array_equal(runs.u[1], alone.u)
        assert runs.statistics.engine.startswith("interpreted")


def test_a_joint_strikes_its_stops_in_a_batch_as_it_does_alone() -> None:
    """Stiff stops, steps as long as the contact: runs without cuts are others. To rounding, and what events make of it.

    The runs that stay between the stops are those of lock step, bit for bit.
    """
    plant = rd.Plant(ARM.with_(gravity=(0.0, 0.0, 0.0)), rd.effects.joint_stops(-0.1, 0.5, 1e5, 0.0))
    setup = rd.Setup(plant, Q, duration_s=1.0, method="RK4", step_s=2e-3, estimate_error=False)
    q0, v0 = np.tile([0.2, 0.15], (70, 1)), np.full((70, 2), [0.05, -0.1])
    strikes = [2, 65]
    v0[strikes] = [[2.0, -1.4], [-0.8, 2.4]]
    runs, uncut = (rd.rollouts(setup, q0, v0, record=EVERYTHING, uncut=passing) for passing in (False, True))
    for i in strikes:
        alone = rd.simulate(setup, q0=q0[i], v0=v0[i])
        assert len(alone.events) > 5 and runs.outcome(i) == alone.outcome and runs.steps[i] == alone.statistics.steps
        np.testing.assert_allclose(runs.q[i], alone.q, rtol=0, atol=1e-11)
        np.testing.assert_allclose(runs.kinetic[i], alone.ledger.kinetic, rtol=0, atol=1e-9)
        np.testing.assert_allclose(runs.work["control"][i], alone.ledger.work["control"], rtol=0, atol=1e-11)
        assert np.abs(uncut.q[i] - alone.q).max() > 1e-3
    others = np.setdiff1d(np.arange(70), strikes)
    for x, y in zip(arrays(runs), arrays(uncut), strict=True):
        np.testing.assert_array_equal(x[others], y[others])
    assert "2 of them repeated with steps cut at thresholds" in runs.statistics.engine
    assert runs.statistics.one_by_one == 2 and uncut.statistics.one_by_one == 0
    assert uncut.uncut == ("lower stop", "upper stop") and runs.uncut == () and runs.comparison is None


def test_events_end_the_runs_of_a_batch_as_they_end_single_ones(tmp_path: Path) -> None:
    """A terminal event: the time to rounding, samples up to it, and the words; also from a file."""
    down = rd.Event(lambda t, q, v: q[0] - 0.35, name="down", terminal=True)
    setup = replace(SETUP, controller=None, events=[down], estimate_error=False, duration_s=0.3)
    q0 = np.array([[0.4, -0.7], [0.5, -0.7], [3.0, 0.2]])
    for method in ("RK4", "DOP853"):
        runs = rd.rollouts(setup, q0, 0 * q0, method=rd.integrate.method(method) if method == "RK4" else method)
        back = rd.read(runs.save(tmp_path / method))
        for i in range(3):
            alone = rd.simulate(runs.setup, q0=q0[i], v0=[0.0, 0.0])
            assert runs.outcome(i).ending == alone.outcome.ending == "finished" and back.outcome(i) == runs.outcome(i)
            assert runs.outcome(i).text == alone.outcome.text
            assert runs.ended_s[i] == pytest.approx(alone.outcome.t, abs=1e-12)
            before = runs.t < runs.ended_s[i] if runs.ended_s[i] < 0.3 else runs.t <= 0.3
            np.testing.assert_allclose(runs.q[i, before], alone.q[: before.sum()], rtol=0, atol=1e-11)
            assert np.isnan(runs.q[i, ~before]).all()
        assert "'down'" in runs.outcome(0).text and not runs.outcome(2).text
        assert "; 0 diverged, 0 stopped, 2 ended by an event" in runs.summary


def interrupt_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let Ctrl-C come at the first look at the threads."""

    def interrupted(*_: Any, **__: Any) -> Any:
        monkeypatch.undo()
        raise KeyboardInterrupt

    monkeypatch.setattr(pool, "wait", interrupted)


@pytest.mark.parametrize("effects", [PLANT.effects[:2], PLANT.effects])
def test_an_interrupt_ends_the_batch_and_keeps_what_there_is(effects, monkeypatch) -> None:
    """Also of runs that were to be made again: theirs are kept up to the step in which they may pass a threshold."""
    short = replace(SETUP, plant=rd.Plant(ARM, effects))
    setup = replace(short, duration_s=100.0, record_every_s=10.0)
    rd.rollouts(short, starts(1))  # compiled before
    interrupt_once(monkeypatch)
    runs = rd.rollouts(setup, starts(200), threads=2)
    assert runs.stopped.any() and not runs.diverged.any()
    i = int(np.flatnonzero(runs.stopped)[-1])
    assert runs.outcome(i).ending == "stopped" and runs.ended_s[i] < 100.0
    assert runs.t[-1] < 100.0 or np.isnan(runs.q[i, runs.t > runs.ended_s[i]]).all()
    assert len(effects) == 3 or runs.t[-1] < 100.0
    assert f"{runs.stopped.sum()} stopped by an interrupt, the first at t = " in runs.summary


def test_a_run_that_was_not_begun_has_its_start(monkeypatch) -> None:
    """An interrupt before the first of runs that are made one after the other: each is a trajectory of one sample."""
    setup = replace(SETUP, method=rd.integrate.method("DOP853"), step_s=None)
    rd.rollouts(setup, starts(1))  # compiled before
    interrupt_once(monkeypatch)
    runs = rd.rollouts(setup, starts(200), record=EVERYTHING, threads=2)
    idle = np.flatnonzero(runs.stopped & (runs.ended_s == 0.0))
    assert len(idle)
    run = runs[int(idle[-1])]
    np.testing.assert_array_equal(run.q, starts(200)[idle[-1:]])
    assert run.summary.startswith("stopped at t = 0 s, 1 samples; interrupted")
