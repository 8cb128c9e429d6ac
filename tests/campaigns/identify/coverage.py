"""Coverage of the intervals of `identify` on simulated logs: python -m tests.campaigns.identify.coverage ur5 10 20.

Each file, friction and motion is random; it runs with several seeds of noise, in closed loop, with one tick of delay.
Instruments are the desired motion; with --instruments, a second log or smoothed positions.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace

import numpy as np

import robot_dyn as rd
from robot_dyn.description import structure_of
from robot_dyn.tools.identify import Estimate, Log, Model, Signals, estimate, low_pass, model_of

TICK_S, DURATION_S, HARMONICS, CUTOFF_HZ = 4e-3, 20.0, 8, 8.0
ENCODER, TORQUE = 3e-5, 0.02  # [rad], and part of the largest torque
LATE_S = -1.5 * TICK_S  # commands act one tick later, and are held for a tick
LOCK = {"panda": {"panda_finger_joint1": 0.0}}
ROTORS = {"ur5": (0.3, 0.3, 0.2, 0.1, 0.1, 0.1), "panda": (0.2,) * 4 + (0.1,) * 3, "kinova": (0.2,) * 3 + (0.1,) * 3}


@dataclass
class Case:
    """A true arm, its friction, a motion and a controller."""

    file: rd.Robot
    true: rd.Robot
    reference: rd.control.PiecewisePolynomial
    viscous: np.ndarray
    coulomb: np.ndarray
    noise: np.ndarray
    loop: rd.control.Loop


def series(coefficients: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return q, v and a of a Fourier series that starts at rest at 0."""
    k = 2 * np.pi * np.arange(1, HARMONICS + 1) / DURATION_S
    A, B = coefficients[0] - np.outer(k, k @ coefficients[0]) / (k @ k), coefficients[1] - coefficients[1].mean(axis=0)
    sin, cos = np.sin(np.outer(t, k)), np.cos(np.outer(t, k))
    return sin @ A + cos @ B, (cos * k) @ A - (sin * k) @ B, -(sin * k**2) @ A - (cos * k**2) @ B


def case(name: str, number: int) -> Case:
    """Return a case: masses within ±30 %, the best conditioned of ten random motions."""
    rng = np.random.default_rng([7, number])
    file = rd.load(name)
    file = file.with_(lock=LOCK.get(name, {})).with_(armature=ROTORS[name])
    structure = structure_of(file.description, file.edits)
    links = [x for links in structure.bodies.values() for x in links if structure.links[x].mass > 0]
    true = file.with_(mass_scales={link: float(np.exp(rng.uniform(-0.3, 0.3))) for link in links})
    has_limits = np.isfinite(file.lower) & (file.upper - file.lower < 6)
    middle = np.where(has_limits, (file.lower + file.upper) / 2, 0.0)
    half = 0.9 * np.minimum(np.where(has_limits, (file.upper - file.lower) / 2, 2.0), 2.0)
    speed = 0.8 * np.where(file.velocity_limit > 0, np.minimum(file.velocity_limit, 2.0), 2.0)
    base, t = model_of(file).base, np.linspace(0, DURATION_S, 150)
    best, least = np.zeros(0), np.inf
    for _ in range(10):
        x = rng.normal(size=(2, HARMONICS, file.n)) / np.sqrt(np.arange(1, HARMONICS + 1))[:, None]
        q, v, _ = series(x, t)
        x = x * np.minimum(half / np.abs(q).max(axis=0), speed / np.abs(v).max(axis=0))
        q, v, a = series(x, t)
        Y = file.regressor(q + middle, v, a)[..., base.columns].reshape(-1, len(base.columns))
        if (condition := np.linalg.cond(Y / np.linalg.norm(Y, axis=0))) < least:
            best, least = x, condition
    q, v, a = series(best, t)
    torque = np.maximum(np.abs(file.inverse_dynamics(q + middle, v, a)).max(axis=0), 2.0)
    knots = np.linspace(0, DURATION_S, 401)
    moved, *rates = series(best, knots)
    reference = rd.control.Samples(knots, moved + middle, *rates)
    lightest = np.min([1 / np.diag(np.linalg.inv(file.M(x + middle))) for x in q], axis=0)
    inner = rd.control.FeedForward(file, reference, kp=400 * lightest, kd=40 * lightest, period_s=TICK_S)
    blocks = [rd.control.Noise(ENCODER)], [rd.control.Differences(), rd.control.LowPass(150.0)]
    loop = rd.control.Loop(inner, *blocks, actuation_delay_periods=1.0)
    viscous, coulomb = rng.uniform(0.05, 0.15, (2, file.n)) * torque
    return Case(file, true, reference, viscous, coulomb, TORQUE * torque, loop)


def simulated(case: Case, seed: int, encoder: float = ENCODER) -> tuple[Log, rd.Trajectory]:
    """Return the log of a run, and the run."""
    q0, v0, _ = case.reference.at(0.0)
    loop = rd.control.Loop(
        *(case.loop.controller, [rd.control.Noise(encoder)], case.loop.velocity),
        actuation_delay_periods=1.0, noise_seed=seed,
    )  # fmt: skip
    dry = rd.effects.RegularisedCoulombFriction(case.coulomb, velocity_scale=0.01)
    run = rd.simulate(
        rd.Plant(case.true, [rd.effects.ViscousFriction(case.viscous), dry]), q0, v0, controller=loop,
        duration_s=DURATION_S, method="RK4", step_s=1e-3, record_every_s=TICK_S, estimate_error=False,
    )  # fmt: skip
    z, rng = run.controller_states, np.random.default_rng([9, seed])
    assert z is not None
    u = z[:, loop.places["coming"]]
    tau = u + rng.normal(size=u.shape) * case.noise
    return Log(run.t, z[:, loop.places["velocity.0"]], tau, case.reference.at(run.t)), run


def bound(case: Case, model: Model, run: rd.Trajectory, found: Estimate) -> np.ndarray:
    """Return the Cramér–Rao bound: standard errors with the true motion and noise, at the times of the rows in the fit.

    Only rates of the torque below the cutoff show the time offset: the faster ones are noise of the encoders.
    """
    every = 5
    Y = model.columns(run.q[::every], run.v[::every], run.a[::every])
    rate = np.gradient(low_pass(run.u, CUTOFF_HZ * TICK_S), TICK_S, axis=0)[::every]
    W = np.concatenate([Y, rate[..., None]], axis=2) / case.noise[:, None]
    row = np.abs(run.t[::every, None] - found.times).argmin(axis=1)
    W = (W * found.rows.used[row][..., None]).reshape(-1, W.shape[2])
    return np.sqrt(np.diag(np.linalg.inv(every * W.T @ W)))


def main(name: str, cases: int, seeds: int, instruments: str = "desired", encoder: float = ENCODER) -> None:
    """Print pooled and worst coverage, efficiency and time offsets."""
    inside, late, ratio, bounds, names = [], [], [], [], ()
    for number in range(cases):
        drawn = case(name, number)
        model = model_of(drawn.file)
        base = model.base
        rotors = np.array(drawn.file.armature)[list(model.rotors)]
        zero = np.zeros(drawn.file.n)
        truth = np.concatenate(
            [base.R @ drawn.true.inertial_parameters, rotors, drawn.viscous, drawn.coulomb, zero, [LATE_S]]
        )
        slow = 0.05 * np.abs(drawn.reference.at(np.linspace(0, DURATION_S, 500))[1]).max(axis=0)
        following = simulated(drawn, 1000 * number, encoder)
        for seed in range(seeds):
            (log, run), following = following, simulated(drawn, 1000 * number + seed + 1, encoder)
            if instruments != "desired":
                log = replace(log, reference=None, repeated=following[0].q if instruments == "second" else None)
            found = estimate(model, log, Signals(0.0, TICK_S, len(log.t), CUTOFF_HZ), slow)
            fit = found.fit
            inside.append(np.abs(fit.values - truth) <= fit.half_widths)
            late.append(fit.values[-1] - LATE_S)
            names = fit.names
            if seed == 0:
                least = bound(drawn, model, run, found)
                ratio.append(fit.standard_errors / least)
                bounds.append(least[-1])
        label = f"{name}, {instruments}, {encoder:g} rad, {len(inside)} runs"
        _report(label, np.array(inside), 1e3 * np.array(late), np.array(ratio), 1e3 * np.array(bounds), names)


def _report(
    label: str, inside: np.ndarray, late: np.ndarray, ratio: np.ndarray, bounds: np.ndarray, names: tuple[str, ...]
) -> None:
    from scipy.stats import beta

    m, hits = len(inside), inside.sum(axis=0)
    worst = int(hits.argmin())
    low = beta.ppf(0.025, hits[worst], m - hits[worst] + 1)
    largest = ratio.max(axis=0)
    print(
        f"{label}: pooled coverage {inside.mean():.4f}; worst {names[worst]}: {hits[worst] / m:.3f}, lower end"
        f" {low:.3f}; standard errors / Cramér–Rao: median {np.median(ratio):.2f}, largest {largest[:-1].max():.2f}"
        f" ({names[int(largest[:-1].argmax())]}), of the time offset {largest[-1]:.2f};"
        f" time offset {late.mean():+.2f} ± {late.std():.2f} ms, largest {np.abs(late).max():.2f} ms, its bound"
        f" {bounds.min():.2f} to {bounds.max():.2f} ms",
        flush=True,
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=ROTORS)
    parser.add_argument("cases", type=int)
    parser.add_argument("seeds", type=int)
    parser.add_argument("--instruments", choices=("desired", "second", "smoothed"), default="desired")
    parser.add_argument("--encoder", type=float, default=ENCODER, help="standard deviation of positions, in [rad]")
    options = parser.parse_args()
    main(options.name, options.cases, options.seeds, options.instruments, options.encoder)
