"""The torque of one joint, split by link and cause: τ_i = Σ_links (M_l a + C_l v + N_l)_i − Σ τ_effect,i."""

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
from robot_dyn.foundations.validate import JointValues, instance
from robot_dyn.lagrange.breakdown import breakdown
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import coefficient_texts, unit, without_rounding

_AT_REST = "dry friction and stops, at rest"
_CAUSES: tuple[str, ...] = "inertia", "Coriolis", "gravity", "effect"


@final
@dataclass(frozen=True)
class Share:
    """The contribution of one link, or of the armature, to a joint's torque, in [N m] or [N].

    Attributes:
        source: Name of the link, or "(armature)".
        inertia: Part of M a.
        coriolis: Part of C v.
        gravity: Part of the torque of gravity.
    """

    source: str
    inertia: float
    coriolis: float
    gravity: float


@final
@dataclass(frozen=True, eq=False, repr=False)
class Why(Answer):
    """The torque of one joint by link and cause; shares, effects and at_rest add up to tau.

    Attributes:
        joint: Name of the joint.
        tau: Torque of the joint, in `unit`, like all other numbers here.
        unit: "N m" for a revolute joint, "N" for a prismatic one.
        shares: Contributions of the moving links that have mass, and of the armature.
        effects: Torque needed against each effect, by name: minus the torque that the effect exerts.
        at_rest: Torque that dry friction and stops balance if the joint is at rest and a follows from tau.
        coefficients: Coefficients of each effect at the joint, as text with units.
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
        yield from ((share.source, share.inertia, share.coriolis, share.gravity, 0.0) for share in self.shares)
        yield from ((effect, 0.0, 0.0, 0.0, torque) for effect, torque in self.effects.items())
        if self.at_rest:
            yield _AT_REST, 0.0, 0.0, 0.0, self.at_rest

    def blocks(self) -> Iterator[Block]:
        yield f"why {self.joint} needs {self.tau:.6g} {self.unit}:"
        named = {effect: ", ".join((effect, *texts)) for effect, texts in self.coefficients.items()}
        sources, terms = [source for source, *_ in self._rows], np.array([terms for _, *terms in self._rows])
        terms = np.vstack([terms.reshape(-1, len(_CAUSES)), terms.reshape(-1, len(_CAUSES)).sum(axis=0)])
        shown = without_rounding(np.column_stack([terms, terms.sum(axis=1)]))  # all in one unit
        names = [*(named.get(source, source) for source in sources), "sum"]
        yield Table(("from", *_CAUSES, "sum"), tuple((name, *row) for name, row in zip(names, shown, strict=True)))

    @property
    def drawing(self) -> str:
        rows: dict[str, dict[str, float]] = {
            source: dict(zip(_CAUSES, terms, strict=True)) for source, *terms in self._rows
        }
        return bars(f"torque of {self.joint} [{self.unit}]", rows, _CAUSES)


def why(
    plant: Plant | Dynamics,
    q: JointValues,
    v: JointValues,
    a: JointValues | None,
    joint: str,
    *,
    tau: JointValues | None = None,
    t: float | None = None,
) -> Why:
    """Split the torque of a joint by link and cause.

        τ_i = Σ_links (M_l a + C_l v + N_l)_i − Σ_effects τ_effect,i

    The `repr` of the result is the table that `robot-dyn query --why` prints; its `to_json()` is the `why` document of
    the command's JSON.

    Args:
        plant: A plant of a robot, or a robot.
        q: Positions, (n,), in [rad] or [m].
        v: Velocities, (n,), in [rad/s] or [m/s].
        a: Accelerations, (n,), in [rad/s²] or [m/s²]; None if tau is passed.
        joint: Name of the joint.
        tau: Actuation, (n,), in [N m] or [N]; determines a and the torque that dry friction and stops balance.
        t: Time, in [s]; required if an effect depends on the time.

    Raises:
        QueryError: If the joint is unknown, the dynamics of the plant is not a robot, not exactly one of a and tau is
            passed, or an argument has another shape or is not finite.
    """
    return why_at(plant_state(plant, q, v, a, tau, t), joint)


def why_at(state: PlantState, joint: str) -> Why:
    """Split the torque of a joint at a state by link and cause; raise a QueryError if the joint is unknown."""
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
    rests = (
        state.is_forward
        and state.v[i] == 0
        and any(x.has_friction or x.stops for x in plant.equation_of_motion.set_valued)
    )
    needed = sum(share.inertia + share.coriolis + share.gravity for share in shares) + sum(effects.values())
    tau = float(state.tau[i])
    return Why(joint, tau, unit("tau", state.types[i]), shares, effects, tau - needed if rests else 0.0, texts)


def _at(force: Force, i: int) -> Force:
    """Return a force with its coefficients at one joint."""
    numbers = {
        name: getattr(force, name) for name, declared_as in declared(type(force)).items() if declared_as.is_per_joint
    }
    return with_values(force, {name: x[i] if np.ndim(x) else x for name, x in numbers.items()})
