"""Laws of the identification: coverage, physical bodies, the corrected file, the verdict, and refused logs."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

import robot_dyn as rd
from robot_dyn.foundations import PlanError
from robot_dyn.tools.identify import (
    MARGIN,
    Fit,
    Identification,
    LogError,
    Rows,
    Signals,
    distance,
    estimate,
    fit,
    identify,
    links_of,
    low_pass,
    model_of,
    nearest_bodies,
    nearest_possible,
    pseudo_inertia,
    read_log,
    whitening,
)  # fmt: skip
from tests.command import spawn
from tests.tools.identify import logs

JOINTS = logs.FILE.joint_names


@cache
def result(seed: int = 0, **options: Any) -> Identification:
    return identify(logs.FILE, logs.log(seed), reference=logs.reference(), **options)


@cache
def truth() -> dict[str, float]:
    base = model_of(logs.FILE).base
    values = dict(zip(base.names, base.R @ logs.true_arm().inertial_parameters, strict=True))
    for joint, b, f in zip(JOINTS, logs.VISCOUS, logs.COULOMB, strict=True):
        values |= {f"{joint} viscous": b, f"{joint} coulomb": f, f"{joint} torque offset": 0.0}
        values[f"{joint} rotor inertia"] = 0.0
    return values


@cache
def fits() -> tuple[Fit, ...]:
    """Return the fits of 10 runs, without the parts of `identify` that follow."""
    model, along = model_of(logs.FILE), logs.reference()
    made = []
    for seed in range(10):
        log = read_log(logs.FILE, logs.log(seed), along)
        signals = Signals(0.0, logs.TICK_S, len(log.t), 8.0)
        made.append(estimate(model, log, signals, np.full(2, 0.05)).fit)
    return tuple(made)


def test_intervals_contain_the_truth() -> None:
    """95 % of 10 runs: at least 0.87, three standard deviations, as about 5 of the 13 parameters are independent."""
    inside = [
        abs(value - truth()[name]) <= width
        for fit in fits()
        for name, value, width in zip(fit.names[:-1], fit.values, fit.half_widths, strict=False)
    ]
    assert np.mean(inside) >= 0.87


@pytest.mark.parametrize("has_repeat", [True, False])
def test_intervals_contain_the_truth_without_the_desired_motion(has_repeat: bool) -> None:
    """Instruments from a second run, or smoothed; 95 % of 10 runs, at least 0.87 as with the desired motion."""
    model, inside = model_of(logs.FILE), []
    for seed in range(10):
        log = read_log(logs.FILE, logs.log(seed), repeat=logs.log((seed + 1) % 10) if has_repeat else None)
        fit = estimate(model, log, Signals(0.0, logs.TICK_S, len(log.t), 8.0), np.full(2, 0.05)).fit
        for name, value, width in zip(fit.names[:-1], fit.values, fit.half_widths, strict=False):
            inside.append(abs(value - truth()[name]) <= width)
    assert np.mean(inside) >= 0.87


def test_a_second_log_may_start_at_another_time() -> None:
    """0.4 s earlier or later: the common part of both logs remains, aligned to two ticks."""
    for first, second in ((100, 0), (0, 100)):
        one, other = ({key: x[k:] for key, x in logs.log(seed).items()} for seed, k in ((0, first), (1, second)))
        log = read_log(logs.FILE, one, repeat=other)
        assert log.repeated is not None and abs(len(log.t) - len(logs.log(0)["t"]) + 100) <= 2
        assert np.abs(log.q - log.repeated).max() < 2 * np.abs(np.diff(log.q, axis=0)).max()


def test_a_second_log_of_another_motion_or_the_log_itself_is_refused() -> None:
    log, other = logs.log(0), logs.log(1)
    for repeat in ({**other, "q": other["q"][::-1]}, log):
        with pytest.raises(LogError, match="repeat"):
            read_log(logs.FILE, log, repeat=repeat)


def test_torques_that_are_too_late_are_refused() -> None:
    """30 ms: the estimate is within 20 ms."""
    log = logs.log(0)
    late = {"t": log["t"][:-8], "q": log["q"][8:], "tau": log["tau"][:-8]}
    with pytest.raises(LogError, match="ms"):
        identify(logs.FILE, late)


def test_static_friction_is_estimated_on_request() -> None:
    """Stribeck's curve in a log of the exact motion: the intervals of both joints hold f_s − f_c in 3 logs."""
    t = np.arange(0.0, logs.DURATION_S, logs.TICK_S)
    q, v, a = logs.reference().at(t)
    static, v_s = logs.COULOMB + np.array([0.6, 0.4]), 0.4
    effects = [
        rd.effects.ViscousFriction(logs.VISCOUS),
        rd.effects.DryFriction(logs.COULOMB, static=static, stribeck_velocity=v_s),
    ]
    tau = logs.FILE.inverse_dynamics(q, v, a) - sum(effect.torque(logs.FILE, 0.0, q, v) for effect in effects)
    for seed in range(3):
        noisy = tau + np.random.default_rng(seed).normal(size=tau.shape) * 0.1
        found = identify(logs.FILE, {"t": t, "q": q, "tau": noisy}, reference=logs.reference(), effects=effects)
        values = {parameter.name: parameter for parameter in found.parameters}
        for joint, excess in zip(JOINTS, static - logs.COULOMB, strict=True):
            parameter = values[f"{joint} static - coulomb"]
            assert abs(parameter.value - excess) < 2 * parameter.half_width < excess
        assert not found.verdict.first


def test_the_fit_takes_part_of_white_noise() -> None:
    """60 parameters of slow columns, 500 rows: their variance is unbiased; 60 draws and parameters allow 3 %."""
    rng, t = np.random.default_rng(0), np.arange(500)
    Y = np.cos(np.pi * np.outer(t + 0.5, np.arange(60)) / 500)[:, None]
    estimates = [
        fit(Rows(tuple(map(str, range(60))), Y, Y, rng.normal(size=(500, 1)), np.ones((500, 1), bool)))
        for _ in range(60)
    ]
    scatter = np.mean([(x.values / x.standard_errors) ** 2 for x in estimates])
    assert abs(scatter - 1) < 0.06


def test_the_time_offset_is_that_of_the_loop() -> None:
    """A tick of delay and half a tick of hold: the mean of 10 runs within 1 ms."""
    assert abs(np.mean([fit.values[-1] for fit in fits()]) - logs.LATE_S) < 1e-3


def test_identified_torques_are_nearer_to_the_truth() -> None:
    q, v, a = logs.reference().at(np.linspace(1, 15, 60))
    true = logs.true_arm().inverse_dynamics(q, v, a)
    error = {arm: np.sqrt(((arm.inverse_dynamics(q, v, a) - true) ** 2).mean()) for arm in (logs.FILE, result().robot)}
    assert error[result().robot] < 0.2 * error[logs.FILE]


def test_held_out_errors_are_below_those_of_the_file() -> None:
    held_out = result().held_out
    assert (held_out.identified < held_out.file_with_friction).all()
    assert (held_out.file_with_friction < held_out.file).all()


def test_bodies_are_possible_and_equal_the_file_where_the_log_is_blind() -> None:
    """With the file's own base parameters the nearest bodies are the file's, to 1e-4 of their size (the solver)."""
    for name in ("planar_2r", "ur5"):
        arm = rd.load(name)
        base, links = model_of(arm).base, links_of(arm)
        theta = nearest_possible(links, base.R, base.R @ arm.inertial_parameters, np.eye(len(base.R)) * 1e-4)
        assert np.allclose(theta / links.sizes, links.theta / links.sizes, atol=1e-3)
        noisy = base.R @ arm.inertial_parameters + np.random.default_rng(0).normal(size=len(base.R)) * 0.3
        for body in nearest_possible(links, base.R, noisy, np.eye(len(base.R)) * 1e-4):
            assert np.linalg.eigvalsh(pseudo_inertia(body)).min() > 0


@pytest.mark.parametrize(("spread", "tolerance"), [(0.1, 1e-6), (0.75, 2e-3)])
def test_the_nearest_bodies_are_those_of_the_log_cholesky_parametrisation(spread: float, tolerance: float) -> None:
    """P = MARGIN·1 + U Uᵀ with U_ii = eˣ has no constraints; its least squares have the same optimum.

    Inside, both agree to 1e-6 of the size. Base parameters that are wrong by ±75 % press a body to the edge of P ⪰ 0,
    where x → −∞: 100 steps leave 1e-5 of the objective and 1e-3 of the size. [Rucker, Wensing 2022]
    """
    base, links = model_of(logs.FILE).base, links_of(logs.FILE)
    own = base.R @ logs.FILE.inertial_parameters
    factors = np.random.default_rng(2).uniform(1 - spread, 1 + spread, len(own))
    A, b = distance(links, base.R, factors * own, np.diag((0.05 * np.abs(own)) ** 2 + 1e-6))
    to_parameters = np.linalg.pinv(np.stack([pseudo_inertia(unit).ravel() for unit in np.eye(10)], axis=1))

    def bodies(x: np.ndarray) -> np.ndarray:
        U = np.zeros((len(links.names), 4, 4))
        U[:, range(4), range(4)], U[:, *np.triu_indices(4, 1)] = np.exp(x[:, :4]), x[:, 4:]
        P = MARGIN * np.eye(4) + U @ U.transpose(0, 2, 1)
        return (P.reshape(-1, 16) @ to_parameters.T).ravel()

    start = np.tile([*[np.log(0.5)] * 4, *[0.0] * 6], len(links.names))
    referee = least_squares(lambda x: A @ bodies(x.reshape(-1, 10)) - b, start, max_nfev=100)
    found = nearest_bodies(A, b)
    assert ((A @ found - b) ** 2).sum() == pytest.approx(2 * referee.cost, rel=1e-5)
    assert np.allclose(found, bodies(referee.x.reshape(-1, 10)), atol=tolerance)
    edge = min(np.linalg.eigvalsh(pseudo_inertia(body))[0] for body in found.reshape(-1, 10)) < 2 * MARGIN
    assert edge == (spread > 0.5)


def test_a_covariance_is_whitened_also_near_a_singular_one() -> None:
    """L Σ Lᵀ = 1; of two equal parameters of variance 1, a common shift by 1 has the distance 1."""
    A = np.random.default_rng(0).normal(size=(5, 5)) * [1e-6, 1.0, 1e3, 1.0, 1.0]
    L = whitening(A.T @ A)
    assert np.allclose(L @ (A.T @ A) @ L.T, np.eye(5), atol=1e-9)
    L = whitening(np.ones((2, 2)))
    assert np.sum((L @ [1.0, 1.0]) ** 2) == pytest.approx(1.0)


def test_links_and_the_rest_of_their_bodies_make_up_the_arm() -> None:
    for name in ("ur5", "kinova", "skew_tree"):
        arm = rd.load(name)
        links = links_of(arm)
        whole = np.einsum("bij,bj->bi", links.X, links.theta) + links.rest
        assert np.allclose(whole.ravel(), arm.inertial_parameters, atol=1e-12)
        assert (links.rest[:, 0] >= -1e-12).all()


def test_the_corrected_file_has_no_new_errors_and_states_the_identified_arm(tmp_path: Path) -> None:
    found = result()
    path = found.save(tmp_path / "arm.urdf")
    checkup = rd.tools.doctor.check_urdf(path)
    before = rd.tools.doctor.check_urdf("planar_2r")
    kinds = {finding.kind for finding in before.findings}
    severe = [x for x in checkup.findings if x.severity.value == "error" and x.kind not in kinds]
    assert checkup.loads and not severe
    again = rd.load(path)
    assert np.allclose(again.inertial_parameters, found.robot.inertial_parameters, rtol=1e-6, atol=1e-9)
    old, new = logs.FILE.description.text.splitlines(), path.read_bytes().splitlines()
    kept = [line for line in old if b"mass" not in line and b"inertia" not in line and b"origin" not in line]
    assert len(set(kept) & set(new)) > 0.7 * len(set(kept))  # the rest is changed by friction


def test_a_heavier_link_is_the_first_cause_and_a_clean_log_has_none() -> None:
    friction = tuple(logs.friction())
    heavy = identify(
        logs.FILE,
        logs.log(0, logs.FILE.with_(mass_scales={"bar_2": 1.5})),
        reference=logs.reference(),
        effects=friction,
    )
    assert ("mass", "bar_2") in [(cause.kind, cause.where) for cause in heavy.verdict.first]
    clean = identify(logs.FILE, logs.log(0, logs.FILE), reference=logs.reference(), effects=friction)
    assert {cause.kind for cause in clean.verdict.first} <= {"time offset"}  # that of the loop


def test_blind_parameters_have_no_numbers() -> None:
    found = result()
    assert not set(found.blind) & {parameter.name for parameter in found.determined}
    assert f"{JOINTS[0]} m" in found.blind


def test_filters_have_zero_phase() -> None:
    """A sine far below the cutoff keeps its phase and amplitude, away from the ends."""
    t = np.arange(2000) * 1e-3
    x = np.sin(2 * np.pi * 2 * t)
    assert np.abs(low_pass(x, 0.03) - x)[300:-300].max() < 1e-4


def test_uneven_times_are_resampled() -> None:
    log = logs.log(0)
    used = np.sort(np.random.default_rng(0).permutation(len(log["t"]))[: len(log["t"]) * 3 // 4])
    uneven = identify(logs.FILE, {key: x[used] for key, x in log.items()}, reference=logs.reference())
    for one, other in zip(uneven.parameters, result().parameters, strict=True):
        assert abs(one.value - other.value) < 3 * (one.half_width + other.half_width)


def with_(**changes: Any) -> dict[str, Any]:
    return {**logs.log(0), **changes}


def flat(values: float, key: str) -> np.ndarray:
    array = logs.log(0)[key].copy()
    array[:, 1] = values
    return array


def tau() -> np.ndarray:
    return logs.log(0)["tau"]


REFUSED: dict[str, tuple[type[Exception], Callable[[], dict[str, Any]], str]] = {
    "a joint that never moves": (LogError, lambda: with_(q=flat(0.3, "q")), JOINTS[1]),
    "no torques": (LogError, lambda: {key: x for key, x in logs.log(0).items() if key != "tau"}, "tau"),
    "a joint without positions": (
        LogError,
        lambda: {"t": logs.log(0)["t"], f"q {JOINTS[0]}": logs.log(0)["q"][:, 0], "tau": tau()},
        f"q {JOINTS[1]}",
    ),
    "a constant torque": (LogError, lambda: with_(tau=flat(1.0, "tau")), JOINTS[1]),
    "a saturated torque": (LogError, lambda: with_(tau=np.minimum(tau(), 0.5 * tau().max(axis=0))), "saturated"),
    "currents without gains": (
        LogError,
        lambda: {"current" if k == "tau" else k: x for k, x in logs.log(0).items()},
        "gains",
    ),
    "swapped columns": (LogError, lambda: with_(tau=tau()[:, ::-1]), "swapped"),
    "a log of another arm": (
        LogError,
        lambda: with_(tau=np.random.default_rng(0).normal(size=tau().shape)),
        "another arm",
    ),
    "too few samples": (LogError, lambda: {key: x[:20] for key, x in logs.log(0).items()}, "samples"),
    "degrees": (PlanError, lambda: with_(q=np.degrees(logs.log(0)["q"])), "deg"),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_a_log_that_does_not_suffice_is_refused(fault: str) -> None:
    error, log, named = REFUSED[fault]
    with pytest.raises(error, match=named):
        identify(logs.FILE, log(), reference=logs.reference())


def test_a_motion_that_determines_too_little_is_refused() -> None:
    """Both joints move alike: their columns of Coulomb friction and offsets differ, but inertias do not."""
    t = np.arange(0, 16, 4e-3)
    q = 0.3 * np.sin(2 * np.pi * 0.2 * t)[:, None] * [1.0, 0.0] + [0.0, 0.2]
    q[:, 1] += 2e-3 * np.sin(2 * np.pi * 0.2 * t)
    v, a = np.gradient(q, 4e-3, axis=0), np.gradient(np.gradient(q, 4e-3, axis=0), 4e-3, axis=0)
    tau = logs.FILE.inverse_dynamics(q, v, a)
    with pytest.raises(LogError):
        identify(logs.FILE.with_(gravity=(0, 0, 0)), {"t": t, "q": q, "tau": tau})


def test_the_command_writes_the_corrected_file(tmp_path: Path) -> None:
    heads = ["t [s]", *(f"q {joint} [rad]" for joint in JOINTS), *(f"tau {joint} [N m]" for joint in JOINTS)]
    for seed, name in enumerate(("log.csv", "again.csv")):
        table = np.column_stack([logs.log(seed)[key] for key in ("t", "q", "tau")])
        np.savetxt(tmp_path / name, table, delimiter=",", header=",".join(heads), comments="")
    code = "import sys, robot_dyn.cli as cli; import robot_dyn.tools.identify.command; cli.main()"
    options = "--output", tmp_path / "arm.urdf", "--repeat", tmp_path / "again.csv", "--effects", "urdf"
    done = spawn("identify", "planar_2r", tmp_path / "log.csv", *options, code=code)
    assert done.returncode == 0, done.stderr
    assert b"wrist" not in done.stdout and b"joint_1 viscous" in done.stdout
    assert rd.load(tmp_path / "arm.urdf").n == 2


def test_reports_are_written(tmp_path: Path) -> None:
    for name in ("report.html", "result.json"):
        text = result().save(tmp_path / name).read_text(encoding="utf-8")
        assert "planar_2r" in text
