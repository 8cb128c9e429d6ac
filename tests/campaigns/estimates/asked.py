"""Random scenes and requests with an accuracy that is asked for, and how these are met."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import robot_dyn as rd
from robot_dyn.simulation import AccuracyError
from tests.campaigns.estimates.scenes import Scene, arms, scene
from tests.campaigns.estimates.truth import truth

FAMILIES = ("smooth", "impact", "friction", "sampled", "stiff")
_OF = {"smooth": 0, "friction": 2, "impact": 3, "sampled": 4, "stiff": 0}  # places among the families of `scene`


def asked_scene(seed: int, index: int) -> tuple[Scene, float]:
    """Scene number `index` of a seed, its method to be chosen, and what is asked: 1e-10 to 1e-3."""
    rng = np.random.default_rng([seed, index, 5])
    family = FAMILIES[index % len(FAMILIES)]
    made = scene(seed, 6 * (index // len(FAMILIES)) + _OF[family])
    plant = made.setup.plant
    if family == "stiff":
        n, scale = plant.dynamics.n, np.diag(plant.dynamics.M(made.setup.q0))
        plant = rd.Plant(
            plant.dynamics, [*plant.effects, rd.effects.ViscousFriction(scale * 10 ** rng.uniform(2, 4.3, n))]
        )
    setup = replace(made.setup, plant=plant, method="auto", step_s=None)
    return Scene(family, setup, made.label), float(10 ** rng.uniform(-10, -3))


@dataclass(frozen=True)
class Answer:
    """What came of a request: errors in [rad], and the words.

    Attributes:
        label: The request.
        asked: The error that was asked for.
        estimated: That of the run; the least of all runs where it was refused.
        true: Against the truth; nan where it was refused.
        unsure: How far two truths are apart.
        refusal: Why it was refused; empty if it was not.
    """

    label: str
    asked: float
    estimated: float
    true: float = np.nan
    unsure: float = np.nan
    refusal: str = ""

    @property
    def met(self) -> bool:
        """Whether the true error is at most what was asked."""
        return self.true - self.unsure <= self.asked

    @property
    def told(self) -> bool:
        """Whether the truth is sure enough to tell."""
        return self.unsure <= self.asked / 2

    @property
    def refused_below(self) -> bool:
        """Whether it was refused although a run was estimated to be within what was asked."""
        return bool(self.refusal) and self.estimated <= self.asked

    def __str__(self) -> str:
        numbers = (f"{name} {getattr(self, name):.1e}" for name in ("asked", "estimated", "true", "unsure"))
        return f"{self.label}: {', '.join(numbers)} {self.refusal}"


def request(seed: int, index: int) -> tuple[Scene, float]:
    """Request number `index` of a seed: 1e-11 to 1e-3 of an arm that is free, rubs, or is under control."""
    rng = np.random.default_rng([seed, index, 23])
    name = ("pendulum", "planar_2r", "ur5", "panda")[index % 4]
    arm = arms()[name]
    n, q, v = arm.n, *rng.uniform(-1, 1, (2, arm.n))
    scale, duration = np.diag(arm.M(q)), float(np.round(rng.uniform(0.05, 1.2), 3))
    effects: list[rd.Effect] = []
    if rng.random() < 0.4:
        effects.append(rd.effects.ViscousFriction(scale * rng.uniform(0.1, 3, n)))
    if rng.random() < 0.2:
        effects.append(rd.effects.RegularisedCoulombFriction(scale * rng.uniform(0.3, 5, n), 10 ** rng.uniform(-2, -1)))
    law, kind = None, rng.random()
    if kind < 0.6:
        plan = rd.control.quintic(q, q + rng.uniform(-0.5, 0.5, n), duration * rng.uniform(0.4, 1.2))
        period = float(rng.choice([0.002, 0.005, 0.01])) if kind < 0.2 else 0.0
        if rng.random() < 0.4:
            gains = rd.control.gains_from(1.0, rng.uniform(3, 12))
            law = rd.control.ComputedTorque(arm.with_(mass_scale=1.1), plan, kp=gains[0], kd=gains[1], period_s=period)
        else:
            kp, kd = rd.control.gains_from(scale, rng.uniform(3, 12), 0.7)
            law = rd.control.PD(plan, kp=kp, kd=kd, period_s=period)
    setup = rd.Setup(
        rd.Plant(arm, effects), q, v, duration, law, record_every_s=duration / 20, engine="interpreted"
    )  # fmt: skip
    return Scene("request", setup, f"{seed}/{index} {name} T={duration:g}"), float(10 ** rng.uniform(-11, -3))


def answer(seed: int, index: int) -> Answer:
    """Make a request, and compare what is delivered with SciPy near rounding over `pin.aba`."""
    made, asked = request(seed, index)
    try:
        run = rd.simulate(made.setup, accuracy=asked)
    except AccuracyError as error:
        return Answer(made.label, asked, error.best, refusal=str(error))
    assert run.accuracy is not None, run.outcome
    exact, other = truth(made.setup, run.t), truth(made.setup, run.t, 2e-13)
    true, unsure = (float(np.abs(exact - q).max()) for q in (run.q, other))
    return Answer(made.label, asked, run.accuracy.estimated, true, unsure)
