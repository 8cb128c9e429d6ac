"""Run i is a function of the specification and i: equal bits whatever the chunk, the threads, the jobs, the engine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps import Work
from robot_dyn.tools.sweeps.rows import digest_of
from tests.long import long, stress
from tests.tools.sweeps.swept import SCENE, digest, scene, swept

NOISE = '\n[[control.position]]\nkind = "noise"\ndeviation_rad = 0.01\n'
NOISY = SCENE.replace('kind = "pd"\n', 'kind = "pd"\nperiod_s = 0.005\n') + NOISE
STOPS = (
    '[[effect]]\nkind = "joint_stops"\nstiffness_N_m_per_rad = 100.0\nlower_rad = -1.0\nupper_rad = 1.0\n\n[control]'
)


@pytest.mark.parametrize(("chunk", "threads"), [(7, 2), *long([(65, 5)]), *stress([(1, 3), (64, 1), (150, 2)])])
def test_rows_do_not_depend_on_chunks_and_threads(tmp_path: Path, chunk: int, threads: int) -> None:
    sweep = swept(tmp_path, 150)
    whole = digest(sweep)
    done = sw.run(sweep, tmp_path / "out", chunk=chunk, threads=threads)
    assert done.verify() == whole
    assert {name for name, count in done.outcomes.items() if count} == {"finished", "diverged", "raised"}


def test_rows_do_not_depend_on_where_steps_are_cut_in_other_runs(tmp_path: Path) -> None:
    """A stop of stiffness 0 is no threshold: such runs go in lock step beside runs whose steps are cut, and alone."""
    vary = {"joint_stops.stiffness": sw.choice([0.0, 500.0]), "q0": sw.normal(mean=[0.4, 0.9], sd=1.5)}
    sweep = swept(scene(tmp_path, SCENE.replace("[control]", STOPS)).parent, 20, vary=vary)
    work = Work(sweep)
    whole = work.rows(0, 20)
    for i in range(0, 20, 4):
        assert digest_of([work.rows(i, i + 1)]) == digest_of([{name: x[i : i + 1] for name, x in whole.items()}]), i


def test_the_order_of_remarks_does_not_depend_on_other_runs(tmp_path: Path) -> None:
    """Chatter of a batch is sorted by its largest amplitude, which is of another joint in other runs."""
    chatters = SCENE.replace('kind = "pd"\n', 'kind = "pd"\nperiod_s = 0.01\n').replace("= 0.05", "= 0.4")
    vary = {"kd": sw.choice([[400.0, 20.0], [100.0, 50.0]]), "q0": sw.normal(mean=[0.4, 0.9], sd=0.2)}
    sweep = swept(scene(tmp_path, chatters).parent, 12, vary=vary)
    work = Work(sweep)
    whole = work.rows(0, 12)
    assert any("chatter u joint_1; chatter u joint_2" in remarks for remarks in whole["remarks"])
    for i in range(12):
        assert digest_of([work.rows(i, i + 1)]) == digest_of([{name: x[i : i + 1] for name, x in whole.items()}]), i


def test_noise_is_numbered_by_the_run_not_by_its_place(tmp_path: Path) -> None:
    sweep = swept(scene(tmp_path, NOISY).parent, 20, vary={"kp": sw.choice([40.0])})
    rows = Work(sweep).rows(0, 20)
    assert len(set(rows["error"].tolist())) == 20  # nothing but noise differs
    assert Work(sweep).rows(7, 8)["error"][0] == rows["error"][7]


SCENES = {
    "plain": SCENE,
    "noise": NOISY,
    "stops": SCENE.replace("[control]", STOPS),
    "steps that are chosen": SCENE.replace('method = "RK4"\nstep_s = 0.001\n', ""),
    "samples between steps": SCENE.replace("[control]", STOPS).replace(
        "record_every_s = 0.001", "record_every_s = 0.0017"
    ),
}


@pytest.mark.parametrize("name", ["plain", "stops", "steps that are chosen", *long(["noise", "samples between steps"])])
def test_a_run_by_itself_has_the_bits_of_its_row(tmp_path: Path, name: str) -> None:
    """It goes alone, and records torques, energies and works too."""
    sweep = swept(scene(tmp_path, SCENES[name]).parent, 12, vary={"q0": sw.normal(mean=[0.4, 0.9], sd=0.6)})
    rows = Work(sweep).rows(0, 12)
    for i in (0, 11):
        run = Work(sweep).run(i)
        assert isinstance(run, rd.Trajectory) and run.q is not None
        assert run.q[-1, 1] == rows["end"][i]
        assert np.abs(run.extremes[1]).max() == rows["peak"][i]
        assert run.q[0].tolist() == [rows["q0[0]"][i], rows["q0[1]"][i]]
        assert run.rms_tracking_error == pytest.approx(rows["error"][i], rel=1e-12)  # another order of the sum


def test_figures_are_those_of_simulate(tmp_path: Path) -> None:
    """The run of `simulate` with the values of a row; to rounding, since lock step orders operations otherwise."""
    sweep = swept(tmp_path, 30, vary={"q0": sw.normal(mean=[0.4, 0.9], sd=0.1), "kp": sw.uniform(low=20, high=60)})
    rows = Work(sweep).rows(0, 30)
    setup = sweep.setup
    for i in (0, 17):
        controller = setup.controller
        gains = rd.control.PD(controller.desired, kp=rows["kp"][i], kd=controller.kd)
        q0 = [rows["q0[0]"][i], rows["q0[1]"][i]]
        run = rd.simulate(
            setup.plant, q0, controller=gains, duration_s=setup.duration_s, method="RK4", step_s=0.001,
            record_every_s=0.001, estimate_error=False,
        )  # fmt: skip
        assert run.rms_tracking_error == pytest.approx(rows["error"][i], rel=1e-9)
        assert run.q[-1, 1] == pytest.approx(rows["end"][i], rel=1e-9)
        assert np.abs(run.v).max() == pytest.approx(rows["peak"][i], rel=1e-9)


def test_jobs_of_an_array_make_each_chunk_once(tmp_path: Path) -> None:
    sweep = swept(tmp_path, 150)
    left = [len(sw.run(sweep, tmp_path / "out", chunk=10, job=f"{job}/4").missing) for job in (3, 1, 4)]
    assert left == [11, 7, 4]  # of 15 chunks these jobs make 4, 4 and 3, and the second makes 4
    done = sw.run(sweep, tmp_path / "out", job="2/4")
    assert done.status["missing"] == 0
    assert done.verify() == digest(sweep)


def test_rollouts_numbered_otherwise_are_those_runs() -> None:
    """`numbers` of rd.rollouts: the noise of run 5 wherever it stands."""
    arm = rd.load("planar_2r")
    hold = rd.control.quintic([0.1, 0.2], [0.3, 0.1], 0.05)
    loop = rd.control.Loop(
        rd.control.PD(hold, kp=40.0, kd=4.0, period_s=0.005), position=rd.control.Noise(0.01), noise_seed=1
    )
    setup = rd.Setup(rd.Plant(arm), [0.1, 0.2], duration_s=0.05, controller=loop, method="RK4")
    whole = rd.rollouts(setup, np.tile([0.1, 0.2], (8, 1)))
    part = rd.rollouts(setup, np.tile([0.1, 0.2], (2, 1)), numbers=[5, 2])
    assert part.q.tobytes() == whole.q[[5, 2]].tobytes()
    assert whole.q[5].tobytes() != whole.q[2].tobytes()
