"""Physical parameters of links: nearest to the file's where the log does not determine them.

    min ‖L (R θ − π)‖² + Σ_i ‖S_i (P_i(θ) − P_i(θ_file)) S_i‖²/σ²,   S_i = P_i(θ_file)^(−1/2)
    subject to   P_i(θ) = [[½ tr(I) 1 − I, m c], [(m c)ᵀ, m]] ⪰ 0

P is the pseudo-inertia: a link is possible exactly if it is positive semidefinite. The distance from the file does not
depend on axes and units; a mass twice as large, with the same shape, has distance 2.
[Wensing, Kim, Slotine 2018; Sousa, Cortesão 2014; Lee, Wensing, Park 2020]
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from scipy.linalg import block_diag

from robot_dyn import ModelWarning, Robot
from robot_dyn.description import parameters as parameters_of
from robot_dyn.description import structure_of, unit_inertias
from robot_dyn.foundations import Value, adjoint_inverse, hat, needs, read_only
from robot_dyn.tools.identify.log import LogError

SPREAD = 0.5  # σ: distance from the file that counts as much as one standard error of a base parameter
_ROUNDING = 1e-12  # least variance of unit parameters, relative to the largest
MARGIN = 1e-6  # least eigenvalue of P, in units of the link
_LEAST_M = 0.02  # [m]: least size of a link


@final
@dataclass(frozen=True, eq=False)
class Links(Value):
    """The links that carry the identified parameters, one for each body.

    Attributes:
        names: Name of the heaviest link of each body, (N,).
        theta: Its parameters in the file, (N, 10), in its frame.
        X: Matrices from the parameters of the link to those of the body, (N, 10, 10).
        rest: Parameters of the other links of each body, (N, 10).
    """

    names: tuple[str, ...]
    theta: np.ndarray
    X: np.ndarray
    rest: np.ndarray

    def __post_init__(self) -> None:
        read_only(self)

    @property
    def sizes(self) -> np.ndarray:
        """Mass, first moment and moment of inertia of the size of each link, (N, 10)."""
        m = np.maximum(self.theta[:, 0], 0.01 * self.theta[:, 0].sum())
        radius = np.sqrt(np.maximum(self.theta[:, [4, 6, 9]].sum(axis=1) / (2 * m), _LEAST_M**2))
        return np.stack([m, *[m * radius] * 3, *[m * radius**2] * 6], axis=1)


def links_of(arm: Robot) -> Links:
    """Return the links of an arm with the numbers of its file.

    Raises:
        LogError: If the arm has payloads or edited masses.
    """
    edits = arm.edits
    if edits.payloads or edits.mass_scale != 1.0 or edits.mass_scales or edits.masses or edits.inertias:
        raise LogError("the arm has payloads or edited masses: identify the arm of its file; use payload() for a load")
    structure, q = structure_of(arm.description, edits), np.zeros(arm.n)
    names = tuple(max(structure.bodies[body], key=lambda x: structure.links[x].mass) for body in arm.body_names)
    twice = {name: 2.0 for name in names if structure.links[name].mass}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        doubled = arm.with_(mass_scales=twice).inertial_parameters if twice else arm.inertial_parameters
    X = np.stack([seen_from(arm, q, body, name) for body, name in zip(arm.body_names, names, strict=True)])
    bodies, own = arm.inertial_parameters.reshape(-1, 10), (doubled - arm.inertial_parameters).reshape(-1, 10)
    return Links(names, np.linalg.solve(X, own[..., None])[..., 0], X, bodies - own)


def seen_from(arm: Robot, q: np.ndarray, body: str, link: str) -> np.ndarray:
    """Return the matrix from parameters in the frame of a link to those in the frame of a body, (10, 10)."""
    g = np.linalg.inv(arm.placement(q, body)) @ arm.placement(q, link)
    A = adjoint_inverse(g[:3, :3], g[:3, 3])
    return np.stack([parameters_of(A.T @ unit @ A) for unit in unit_inertias(np.dtype(float))], axis=1)


def pseudo_inertia(theta: np.ndarray) -> np.ndarray:
    """Return P, (4, 4), of parameters (10,)."""
    m, x, y, z, Ixx, Ixy, Iyy, Ixz, Iyz, Izz = theta
    half = (Ixx + Iyy + Izz) / 2
    return np.array(
        [[half - Ixx, -Ixy, -Ixz, x], [-Ixy, half - Iyy, -Iyz, y], [-Ixz, -Iyz, half - Izz, z], [x, y, z, m]]
    )


def nearest_possible(links: Links, R: np.ndarray, values: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return possible parameters of the links, (N, 10), that fit base parameters π, (r,), with their covariance.

    Raises:
        LogError: If the solver finds none.
        MissingExtraError: If cvxpy or clarabel is not installed.
    """
    return nearest_bodies(*distance(links, R, values, covariance)).reshape(-1, 10) * links.sizes


def distance(links: Links, R: np.ndarray, values: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return A and b of the objective ‖A x − b‖², with x = θ in units of the sizes, (10 N,)."""
    N, sizes = len(links.names), links.sizes
    L = whitening(covariance)
    to_base = np.einsum("rbk,bkj->rbj", R.reshape(len(R), N, 10), links.X) * sizes
    metric = np.asarray(block_diag(*map(_metric, links.theta, sizes))) / SPREAD
    b = np.concatenate([L @ (values - R @ links.rest.ravel()), metric @ (links.theta / sizes).ravel()])
    return np.vstack([L @ to_base.reshape(len(R), -1), metric]), b


def whitening(covariance: np.ndarray) -> np.ndarray:
    """Return L with Lᵀ L = Σ⁻¹; combinations with a variance near rounding get that of rounding."""
    errors = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(errors, errors))
    return (vectors / np.sqrt(np.maximum(values, _ROUNDING * values[-1]))).T / errors


def nearest_bodies(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the parameters of possible bodies, (10 N,) in units of their sizes, that minimise ‖A x − b‖².

    Raises:
        LogError: If the solver finds none.
        MissingExtraError: If cvxpy or clarabel is not installed.
    """
    cp: Any = needs("cvxpy", extra="identify")
    needs("clarabel", extra="identify")
    x, units = cp.Variable(A.shape[1]), np.stack([pseudo_inertia(unit).ravel() for unit in np.eye(10)], axis=1)
    possible = [
        cp.reshape(units @ x[k : k + 10], (4, 4), order="C") >> MARGIN * np.eye(4) for k in range(0, len(A.T), 10)
    ]
    problem = cp.Problem(cp.Minimize(cp.sum_squares(A @ x - b)), possible)
    try:
        problem.solve(solver=cp.CLARABEL)
    except cp.SolverError:
        x.value = None
    if x.value is None or problem.status not in ("optimal", "optimal_inaccurate"):
        raise LogError(f"no possible bodies fit the log ({problem.status}); check the arm and the units of the torques")
    return np.asarray(x.value)


def _metric(theta: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the matrix (16, 10) from a change of parameters, in units of the size, to S ΔP S."""
    least = np.array([size[0], 0, 0, 0, *[0.1 * size[4] if k in (0, 2, 5) else 0.0 for k in range(6)]])
    values, vectors = np.linalg.eigh(pseudo_inertia(theta))
    floor = np.linalg.eigvalsh(pseudo_inertia(least)).min()
    S = (vectors / np.sqrt(np.maximum(values, floor))) @ vectors.T
    return np.stack([(S @ pseudo_inertia(unit) @ S).ravel() for unit in np.diag(size)], axis=1)


def centred(theta: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass, centre of mass, (3,), and moments of inertia about it, (3, 3), of parameters (10,)."""
    m, c = float(theta[0]), theta[1:4] / theta[0]
    Ixx, Ixy, Iyy, Ixz, Iyz, Izz = theta[4:]
    return m, c, np.array([[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]]) + m * hat(c) @ hat(c)
