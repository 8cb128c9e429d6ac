"""The queries of every engine, and their table: rigid bodies in gravity, M(q) a + C(q, v) v + N(q) = τ, N = ∂V/∂q.

To add a query, write a method of `Dynamics`, Pinocchio's call in `model/calls.py` and the formula in
`lagrange/formulas.py`, both under its name. Engines, machine code, cross-check, certificates and commands follow.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Generic, TypeVar, cast

import numpy as np

from robot_dyn.foundations.arithmetic import FLOAT64, Array, rounding
from robot_dyn.foundations.errors import OverflowedError, SingularError, UndecidedError, shown
from robot_dyn.foundations.linear_algebra import NotPositiveDefiniteError, cholesky_solve
from robot_dyn.foundations.suggestions import SuggestsNames
from robot_dyn.foundations.validate import JointValues, check_batches, choice, shaped
from robot_dyn.queries.batch import into
from robot_dyn.queries.quantity import DOUBTFUL, Quantity, query, table

T = TypeVar("T")
Answer = TypeVar("Answer")  # array type of an engine


class Axes(StrEnum):
    """Axes and reference point of the twist of a frame.

    WORLD_ALIGNED: at the frame's origin, along the base's axes: its linear part is ṗ. Pinocchio's LOCAL_WORLD_ALIGNED.
    BODY: at the frame's origin, along the frame's axes: the body twist g⁻¹ġ. Pinocchio's LOCAL.
    WORLD: at the base's origin, along the base's axes: the spatial twist ġg⁻¹. Pinocchio's WORLD.

    Pinocchio's names are also accepted, as strings or as `pinocchio.ReferenceFrame`.
    """

    WORLD_ALIGNED = "world_aligned"
    BODY = "body"
    WORLD = "world"

    @classmethod
    def from_name(cls, name: object) -> Axes:
        """Return the axes of a name; raise QueryError if it is unknown."""
        text = name if isinstance(name, str) else str(getattr(name, "name", shown(name)))  # Pinocchio's have names
        return cls(choice("expressed_in", _OF_PINOCCHIO.get(text, text), list(cls)))


_OF_PINOCCHIO = {"LOCAL": "body", "LOCAL_WORLD_ALIGNED": "world_aligned", "WORLD": "world"}
_OF_PINOCCHIO |= {name.lower(): axes for name, axes in _OF_PINOCCHIO.items()}


def _solved_torque(size: Any, x: Mapping[str, Array]) -> Any:
    """Return the terms of τ − C v − N."""
    return size.inverse_dynamics(x["v"], np.zeros_like(x["v"])) + x["tau"]


def _placement_terms(size: Any, x: Mapping[str, Array], frame: str) -> np.ndarray:
    """Return 1 for the rotation, and the distance from the base for the position."""
    distance = max(size.reach[frame], np.finfo(float).tiny)  # 0 would mean an entry without terms
    return np.vstack([np.hstack([np.ones((3, 3)), np.full((3, 1), distance)]), [0.0, 0.0, 0.0, 1.0]])


def _jacobian_terms(size: Any, x: Mapping[str, Array], frame: str) -> np.ndarray:
    """Return the sum of lever and reach: a lever is a difference of positions, which have the scale of the reach."""
    arm = size.lever[frame] + size.reach[frame]
    return np.vstack([np.tile(arm, (3, 1)), np.ones((3, len(arm)))])


def _jacobian_rate_terms(size: Any, x: Mapping[str, Array], frame: str) -> np.ndarray:
    arm, v = size.lever[frame] + size.reach[frame], x["v"]
    return np.vstack([np.tile(arm * v.sum() + arm @ v, (3, 1)), np.full((3, len(v)), v.sum())])


class Dynamics(SuggestsNames, ABC, Generic[Answer]):
    """Rigid bodies in gravity: M(q) a + C(q, v) v + N(q) = τ.

    `q`, `v`, `a`, `tau` have shape (n,), or (..., n) in a batch, in [rad], [rad/s], [rad/s²], [N m] for a revolute
    joint and [m], [m/s], [m/s²], [N] for a prismatic one. Twists are (linear, angular). Every method raises
    QueryError for a wrong shape, a non-finite value or an unknown frame, and OverflowedError if the result would not be
    finite; in a batch the message and the error's `row` identify the state. The queries of `nan_rows` return NaN for
    such states instead.

    An engine defines `n`, `joint_names` and `_answer`; it overrides a query only to add a fast path for one state.
    """

    @property
    @abstractmethod
    def n(self) -> int:
        """Number of degrees of freedom."""

    @property
    @abstractmethod
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints, in the order of q."""

    @abstractmethod
    def _answer(
        self, name: str, state: tuple[Any, ...], out: Any, frame: tuple[str, ...] = (), *, nan: bool = False
    ) -> Any:
        """Return the result of a query.

        Args:
            name: Name of the query.
            state: Arguments as passed by the user.
            out: Array for the result, or None.
            frame: Frame and axes of its twist, if the query has them.
            nan: True for NaN at states without a result, False for an error.
        """

    @property
    def nan_rows(self) -> Dynamics[Answer]:
        """The same queries, with NaN instead of an error for each state without a result.

        A state has no result if it is not finite, the result would overflow, or M is singular in forward dynamics.
        """
        return NanRows(self)

    @query("n", "n", unit="kg m²", terms=lambda size, x: size.M, definite=True, digits=True)
    def M(self, q: JointValues, *, out: Answer | None = None) -> Answer:
        """Mass matrix of the kinetic energy K = ½ vᵀ M v, symmetric positive definite."""
        return self._answer("M", (q,), out)

    @query("n", "n", unit="N m s/rad", terms=lambda size, x: size.C(x["v"]), digits=True)
    def C(self, q: JointValues, v: JointValues, *, out: Answer | None = None) -> Answer:
        """Coriolis matrix of the Christoffel symbols, so that Ṁ = C + Cᵀ."""
        return self._answer("C", (q, v), out)

    @query("n", unit="N m", terms=lambda size, x: size.N, digits=True)
    def N(self, q: JointValues, *, out: Answer | None = None) -> Answer:
        """Gravity torque ∂V/∂q: the torque that holds the robot at rest."""
        return self._answer("N", (q,), out)

    @query("n", unit="N m", terms=lambda size, x: size.C(x["v"]) @ x["v"])
    def coriolis_torque(self, q: JointValues, v: JointValues, *, out: Answer | None = None) -> Answer:
        """Coriolis and centrifugal torque C(q, v) v."""
        return self._answer("coriolis_torque", (q, v), out)

    @query("n", unit="N m", terms=lambda size, x: size.C(x["v"]).T @ x["v"])
    def coriolis_transpose(self, q: JointValues, v: JointValues, *, out: Answer | None = None) -> Answer:
        """Cᵀ(q, v) v = ∂K/∂q, used by momentum observers: d(M v)/dt = τ + Cᵀ v − N."""
        return self._answer("coriolis_transpose", (q, v), out)

    @query("n", unit="N m", terms=lambda size, x: size.inverse_dynamics(x["v"], x["a"]), digits=True)
    def inverse_dynamics(self, q: JointValues, v: JointValues, a: JointValues, *, out: Answer | None = None) -> Answer:
        """Torque of an acceleration: τ = M a + C v + N."""
        return self._answer("inverse_dynamics", (q, v, a), out)

    @query("n", unit="rad/s²", terms=_solved_torque, solves=True, doubtful=DOUBTFUL, digits=True)
    def forward_dynamics(
        self, q: JointValues, v: JointValues, tau: JointValues, *, out: Answer | None = None
    ) -> Answer:
        """Acceleration of a torque: a = M⁻¹ (τ − C v − N)."""
        return self._answer("forward_dynamics", (q, v, tau), out)

    @query(unit="J", terms=lambda size, x: x["v"] @ size.M @ x["v"] / 2)
    def kinetic_energy(self, q: JointValues, v: JointValues, *, out: Answer | None = None) -> Any:
        """Kinetic energy K = ½ vᵀ M v."""
        return self._answer("kinetic_energy", (q, v), out)

    @query(unit="J", terms=lambda size, x: size.V)
    def potential_energy(self, q: JointValues, *, out: Answer | None = None) -> Any:
        """Potential energy of gravity V = −Σ mᵢ gᵀ pᵢ of the moving bodies, 0 at the origin of the base."""
        return self._answer("potential_energy", (q,), out)

    @query("n", unit="N m s", terms=lambda size, x: size.M @ x["v"])
    def momentum(self, q: JointValues, v: JointValues, *, out: Answer | None = None) -> Answer:
        """Generalised momentum p = ∂K/∂v = M v."""
        return self._answer("momentum", (q, v), out)

    @query(3, "n", "n", unit="N m by rad, rad/s, rad/s²", terms=lambda size, x: size.derivatives(x["v"], x["a"]))
    def inverse_dynamics_derivatives(
        self, q: JointValues, v: JointValues, a: JointValues, *, out: Answer | None = None
    ) -> Answer:
        """Derivatives of inverse dynamics τ = M a + C v + N: ∂τ/∂q, ∂τ/∂v = 2 C and ∂τ/∂a = M, in this order."""
        return self._answer("inverse_dynamics_derivatives", (q, v, a), out)

    @query(3, unit="m", terms=lambda size, x: np.full(3, size.moment / size.mass))
    def centre_of_mass(self, q: JointValues, *, out: Answer | None = None) -> Answer:
        """Centre of mass of the moving bodies, in base axes."""
        return self._answer("centre_of_mass", (q,), out)

    @query(3, "n", unit="m/s by v", terms=lambda size, x: np.tile(size.carried / size.mass, (3, 1)))
    def centre_of_mass_jacobian(self, q: JointValues, *, out: Answer | None = None) -> Answer:
        """Jacobian of the centre of mass, ċ = J v, in base axes."""
        return self._answer("centre_of_mass_jacobian", (q,), out)

    @query(3, "n", unit="m/s² by v", terms=lambda size, x: np.tile(size.carried_rate(x["v"]) / size.mass, (3, 1)))
    def centre_of_mass_jacobian_rate(self, q: JointValues, v: JointValues, *, out: Answer | None = None) -> Answer:
        """Rate of change dJ/dt of the Jacobian of the centre of mass, along v."""
        return self._answer("centre_of_mass_jacobian_rate", (q, v), out)

    @query(6, "n", unit="kg m/s and kg m²/s by v", terms=lambda size, x: size.momentum_matrix())
    def centroidal_momentum_matrix(self, q: JointValues, *, out: Answer | None = None) -> Answer:
        """Centroidal momentum matrix A_G of the moving bodies: momentum (linear, angular) = A_G v about their centre.

        The momentum is in base axes; its linear part is m ċ. Armature does not count. [Orin, Goswami, Lee 2013]
        """
        return self._answer("centroidal_momentum_matrix", (q,), out)

    @query("n", "p", unit="N m by parameter", terms=lambda size, x: size.regressor(x["v"], x["a"]))
    def regressor(
        self, q: JointValues, v: JointValues, a: JointValues, v_r: JointValues | None = None,
        *, out: Answer | None = None,
    ) -> Answer:  # fmt: skip
        """Regressor of the joint torques, Y(q, v, a) with M a + C v + N = Y θ + armature · a, θ `inertial_parameters`.

        For adaptive controllers, with a reference velocity v_r and its acceleration a: Y θ = M a + C(q, v) v_r + N −
        armature · a. C is linear in v, so this is Y(½(v + v_r), a) − Y(½(v − v_r), 0) + Y(0, 0).

        Y depends on geometry, gravity and couplings, but not on masses: θ can be identified from measured torques,
        except for combinations that no motion distinguishes, for which Y is rank-deficient.
        [Atkeson, An, Hollerbach 1986; Slotine, Li 1987; Siciliano et al. 2009, §7.2.2]
        """
        if v_r is None:
            return self._answer("regressor", (q, v, a), out)
        arithmetic, Y = getattr(self, "arithmetic", FLOAT64), cast(Any, self.regressor)
        velocities = {name: shaped(name, x, self.joint_names, arithmetic) for name, x in (("v", v), ("v_r", v_r))}
        check_batches(**velocities)
        with arithmetic.scope():
            mean, half = sum(velocities.values()) / 2, (velocities["v"] - velocities["v_r"]) / 2
            zero = 0 * half
            return cast(Any, into)(out, Y(q, mean, a) - Y(q, half, zero) + Y(q, zero, zero))

    @query(4, 4, unit="1 and m", terms=_placement_terms)
    def placement(self, q: JointValues, frame: str, *, out: Answer | None = None) -> Answer:
        """Placement of a frame in the base: the homogeneous matrix [[R, p], [0, 1]]."""
        return self._answer("placement", (q,), out, (frame,))

    @query(6, "n", unit="m/s and rad/s by v", terms=_jacobian_terms)
    def jacobian(
        self, q: JointValues, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED, out: Answer | None = None,
    ) -> Answer:  # fmt: skip
        """Jacobian J(q) of a frame: twist = J v, (linear, angular)."""
        return self._answer("jacobian", (q,), out, (frame, expressed_in))

    @query(6, "n", unit="m/s² and rad/s² by v", terms=_jacobian_rate_terms)
    def jacobian_rate(
        self, q: JointValues, v: JointValues, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED,
        out: Answer | None = None,
    ) -> Answer:  # fmt: skip
        """Rate of change dJ/dt of the Jacobian of a frame, along v."""
        return self._answer("jacobian_rate", (q, v), out, (frame, expressed_in))

    def total_energy(self, q: JointValues, v: JointValues) -> Any:
        """Return the total energy E = K + V, which is constant if only gravity acts.

        Args:
            q: Positions, shape (..., n), in [rad] or [m] by joint.
            v: Velocities, shape (..., n), in [rad/s] or [m/s].

        Returns:
            Energy, shape (...), in [J].
        """
        return self.kinetic_energy(q, v) + self.potential_energy(q)


@dataclass(frozen=True)
class NanRows(Dynamics[Answer]):
    """The queries of an engine, with NaN for states without a result; see `Dynamics.nan_rows`."""

    engine: Dynamics[Answer]

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return self.engine.n

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints, in the order of q."""
        return self.engine.joint_names

    def _answer(
        self, name: str, state: tuple[Any, ...], out: Any, frame: tuple[str, ...] = (), *, nan: bool = True
    ) -> Any:
        return self.engine._answer(name, state, out, frame, nan=True)


QUANTITIES = table(Dynamics)
EQUATION = {
    name: quantity for name, quantity in QUANTITIES.items() if not quantity.framed
}  # the queries of machine code
M, C, N = (QUANTITIES[name] for name in ("M", "C", "N"))
CORIOLIS_TORQUE, INVERSE_DYNAMICS, FORWARD_DYNAMICS = (
    QUANTITIES[name] for name in ("coriolis_torque", "inverse_dynamics", "forward_dynamics")
)
FORWARD_DYNAMICS_DERIVATIVES = Quantity(  # machine code only
    "forward_dynamics_derivatives", ("q", "v", "tau"), (3, "n", "n"), terms=_solved_torque, solves=True
)
PLANT = {  # queries of a plant, which include its effects
    "N": replace(N, arguments=("t", "q", "v")),
    "torque": Quantity("torque", ("t", "q", "v"), ("n",)),
    "inverse_dynamics": replace(INVERSE_DYNAMICS, arguments=("t", "q", "v", "a")),
    "forward_dynamics": replace(FORWARD_DYNAMICS, arguments=("t", "q", "v", "u")),
}


def acceleration(M: Array, tau: Array, joint_names: tuple[str, ...]) -> Array:
    """Solve M a = τ for M (..., n, n) and the remaining torque τ (..., n).

    Raises:
        SingularError: If M is not positive definite; names the joint.
        UndecidedError: If rounding makes this undecidable.
    """
    if M.shape[:-2] != tau.shape[:-1]:
        batch = np.broadcast_shapes(M.shape[:-2], tau.shape[:-1])
        M, tau = np.broadcast_to(M, (*batch, *M.shape[-2:])), np.broadcast_to(tau, (*batch, *tau.shape[-1:]))
    try:
        return cholesky_solve(M, tau)
    except NotPositiveDefiniteError as error:
        if M.dtype.kind == "f" and not np.isfinite(M).all():
            raise OverflowedError("q is so large that M overflows; use a smaller q") from None
        joint = joint_names[error.row]
        if error.decided:
            raise SingularError(joint, "at this q") from None
        raise UndecidedError(joint, "at this q", rounding(M)) from None


def entry(table: Mapping[str, T], frame: str) -> T:
    """Return the entry of a table for a frame; raise QueryError with similar names if it is unknown."""
    return table[choice("frame", frame, table)]
