"""Why a joint needs its torque: τ_i = Σ_links (M_l a + C_l v + N_l)_i − Σ τ_effect,i, split by link and cause."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.effects.effect import Force
from robot_dyn.effects.plant import Plant
from robot_dyn.effects.plant_state import PlantState, plant_state
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.coefficients import declared, with_values
from robot_dyn.foundations.display import bars
from robot_dyn.foundations.errors import QueryError, nearest
from robot_dyn.foundations.validate import instance
from robot_dyn.lagrange.breakdown import breakdown
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import coefficient_texts, unit, without_rounding

_AT_REST = "dry friction and stops, at rest"
_CAUSES: tuple[str, ...] = "inertia", "Coriolis", "gravity", "effect"


@final
@dataclass(frozen=True)
class Share:
    """What one link, or the armature, adds to a joint's torque, in [N m] or [N]."""

    source: str
    inertia: float
    coriolis: float
    gravity: float


@final
@dataclass(frozen=True, eq=False, repr=False)
class Why(Answer):
    """One joint's torque by link and cause; shares, effects and at_rest add up to tau.

    Attributes:
        joint: Name of the joint.
        tau: Its torque, in `unit`, as all other numbers here.
        unit: "N m" for a joint that turns, "N" for one that slides.
        shares: Of each link that moves and has mass, and of the armature.
        effects: What each effect asks for, by name: the torque that it exerts, with the opposite sign.
        at_rest: What dry friction and stops balance of a joint whose velocity is 0, where a follows from tau.
        coefficients: Of each effect at the joint, in words with units.
    """

    joint: str
    tau: float
    unit: str
    shares: tuple[Share, ...]
    effects: dict[str, float]
    at_rest: float
    coefficients: dict[str, tuple[str, ...]]

    @property
    def _rows(self) -> Iterator[tuple[str, float, float, float, float]]:
        """Source, inertia, Coriolis, gravity and effect."""
        yield from ((each.source, each.inertia, each.coriolis, each.gravity, 0.0) for each in self.shares)
        yield from ((effect, 0.0, 0.0, 0.0, torque) for effect, torque in self.effects.items())
        if self.at_rest:
            yield _AT_REST, 0.0, 0.0, 0.0, self.at_rest

    def blocks(self) -> Iterator[Block]:
        yield f"why {self.joint} needs {self.tau:.6g} {self.unit}:"
        named = {effect: ", ".join((effect, *texts)) for effect, texts in self.coefficients.items()}
        sources, terms = [source for source, *_ in self._rows], np.array([terms for _, *terms in self._rows])
        terms = np.vstack([terms.reshape(-1, len(_CAUSES)), terms.reshape(-1, len(_CAUSES)).sum(axis=0)])
        shown = without_rounding(np.column_stack([terms, terms.sum(axis=1)]))  # all of one torque
        names = [*(named.get(source, source) for source in sources), "sum"]
        yield Table(("from", *_CAUSES, "sum"), tuple((name, *row) for name, row in zip(names, shown, strict=True)))

    @property
    def drawing(self) -> str:
        rows: dict[str, dict[str, float]] = {
            source: dict(zip(_CAUSES, terms, strict=True)) for source, *terms in self._rows
        }
        return bars(f"torque of {self.joint} [{self.unit}]", rows, _CAUSES)


def why(
    plant: Plant | Dynamics, q: Any, v: Any, a: Any | None, joint: str, *, tau: Any | None = None, t: float = 0.0
) -> Why:
    """Why a joint needs its torque: its shares by link and cause, which add up to it.

        τ_i = Σ_links (M_l a + C_l v + N_l)_i − Σ_effects τ_effect,i

    Its `repr` is the table that `robot-dyn query --why` prints, `to_json()` the document `why` of its JSON.

    Args:
        plant: A plant of a robot, or a robot.
        q: Positions, (n,), in [rad] or [m].
        v: Velocities, (n,), in [rad/s] or [m/s].
        a: Accelerations, (n,), in [rad/s²] or [m/s²]; None where tau is given.
        joint: Name of the joint.
        tau: Actuation, (n,), in [N m] or [N], from which a follows, and what dry friction and stops balance.
        t: Time, in [s], for effects that come and go.

    Raises:
        QueryError: If the joint is unknown, the plant is not of a robot, neither or both of a and tau are given, or one
            of them has another shape or is not finite.
    """
    return why_at(plant_state(plant, q, v, a, tau, t), joint)


def why_at(state: PlantState, joint: str) -> Why:
    """One joint's torque in a state; QueryError if the joint is unknown."""
    if instance("joint", joint, str, "give the name of a joint") not in state.joints:
        raise QueryError(f"why: no joint {joint!r}; {nearest(joint, state.joints)}")
    i, plant = state.joints.index(joint), state.plant
    robot: Any = plant.dynamics
    shares = tuple(
        Share(part.source, float(part.M[i] @ state.a), float(part.C[i] @ state.v), float(part.N[i]))
        for part in breakdown(Lagrangian(robot), state.q, state.v)
    )
    effects = {name: 0.0 - float(torque[i]) for name, torque in state.effects.items()}
    texts = {
        name: tuple(coefficient_texts(_at(force, i), state.types[i : i + 1]).values())
        for name, force in zip(state.effects, plant.forces, strict=True)
    }
    rests = state.of_tau and state.v[i] == 0 and any(x.rubs or x.stops for x in plant.equation_of_motion.set_valued)
    needed = sum(each.inertia + each.coriolis + each.gravity for each in shares) + sum(effects.values())
    tau = float(state.tau[i])
    return Why(joint, tau, unit("tau", state.types[i]), shares, effects, tau - needed if rests else 0.0, texts)


def _at(force: Force, i: int) -> Force:
    """A force as it is at one joint."""
    numbers = {name: getattr(force, name) for name, each in declared(type(force)).items() if each.of_joints}
    return with_values(force, {name: x[i] if np.ndim(x) else x for name, x in numbers.items()})
