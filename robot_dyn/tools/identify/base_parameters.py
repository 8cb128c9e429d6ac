"""Base parameters: the combinations of inertial parameters that joint torques depend on.

    Y(q, v, a) θ = Y_k π,   π = R θ,   Y = Y_k R,   Y_k independent columns of Y

Columns are taken from the base to the tip, so a parameter that depends on earlier ones is regrouped with bodies nearer
to the base. [Gautier, Khalil 1990; Gautier 1991]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn import Robot
from robot_dyn.description import parameter_names
from robot_dyn.foundations import Value, read_only

_STATES = 400
_DEPENDENT = 1e-8  # remainder of a unit column after projection: far above rounding, far below independent columns
_NEGLIGIBLE = 1e-7  # fraction of the largest entry of R


@final
@dataclass(frozen=True, eq=False)
class BaseParameters(Value):
    """The base parameters π = R θ of an arm.

    Attributes:
        columns: Indices of the independent columns of the regressor, (r,).
        R: Matrix of the combinations, (r, 10 N).
        full_names: Names of the inertial parameters θ, (10 N,).
    """

    columns: np.ndarray
    R: np.ndarray
    full_names: tuple[str, ...]

    def __post_init__(self) -> None:
        read_only(self)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the leading parameters, (r,); other parameters may be regrouped with them."""
        return tuple(self.full_names[k] for k in self.columns)

    @property
    def blind(self) -> tuple[str, ...]:
        """Names of the inertial parameters that no torque depends on."""
        return tuple(name for name, used in zip(self.full_names, np.abs(self.R).max(axis=0), strict=True) if not used)


def base_parameters(arm: Robot, *, at_rest: bool = False) -> BaseParameters:
    """Return the base parameters of an arm, from its regressor at 400 random states; `at_rest`, those of gravity."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (_STATES, arm.n))  # beyond the limits too: the functions are analytic
    Y = np.asarray(arm.regressor(q, *rng.normal(0.0, 0.0 if at_rest else 2.0, (2, _STATES, arm.n))))
    Y = Y.reshape(-1, Y.shape[-1])
    sizes = np.linalg.norm(Y, axis=0)
    unit = np.divide(Y, sizes, out=np.zeros_like(Y), where=sizes > _DEPENDENT * sizes.max())
    Q, columns = np.zeros((len(unit), 0)), []
    for k, column in enumerate(unit.T):
        rest = column - Q @ (Q.T @ column)
        rest = rest - Q @ (Q.T @ rest)  # twice is enough [Kahan, Parlett]
        if np.linalg.norm(rest) > _DEPENDENT:
            Q, columns = np.column_stack([Q, rest / np.linalg.norm(rest)]), [*columns, k]
    R = np.linalg.lstsq(Y[:, columns], Y * (unit != 0).any(axis=0), rcond=None)[0]
    R[np.abs(R) < _NEGLIGIBLE * np.abs(R).max()] = 0.0
    R[:, columns] = np.eye(len(columns))
    return BaseParameters(np.array(columns), R, parameter_names(arm.body_names))
