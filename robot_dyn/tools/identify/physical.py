"""Physical parameters of links: nearest to the file's where the log does not determine them.

    min ‖L (R θ − π)‖² + Σ_i ‖S_i (P_i(θ) − P_i(θ_file)) S_i‖²/σ²,   S_i = P_i(θ_file)^(−1/2)
    subject to   P_i(θ) = [[½ tr(I) 1 − I, m c], [(m c)ᵀ, m]] ⪰ 0

P is the pseudo-inertia: a link is possible exactly if it is positive semidefinite. The distance from the file does not
depend on axes and units; a mass twice as large, with the same shape, has distance 2.
[Wensing, Kim, Slotine 2018; Sousa, Cortesão 2014; Lee, Wensing, Park 2020]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn import Robot
from robot_dyn.description import StatedLink, structure_of, unit_inertias
from robot_dyn.description import parameters as parameters_of
from robot_dyn.foundations import Value, adjoint_inverse, needs, read_only, rotation_rpy
from robot_dyn.tools.identify.log import LogError

SPREAD = 0.5  # σ: distance from the file that counts as much as one standard error of a base parameter
_MARGIN = 1e-6  # least eigenvalue of P, in units of the link
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
    structure, E = structure_of(arm.description, edits), unit_inertias(np.dtype(float))
    q, names, theta, X, rest = np.zeros(arm.n), [], [], [], []
    body_theta = arm.inertial_parameters.reshape(-1, 10)
    for body, whole in zip(arm.body_names, body_theta, strict=True):
        heaviest = max(structure.bodies[body], key=lambda link: structure.links[link].mass)
        g = np.linalg.inv(arm.placement(q, body)) @ arm.placement(q, heaviest)
        A = adjoint_inverse(g[:3, :3], g[:3, 3])
        names.append(heaviest)
        X.append(np.stack([parameters_of(A.T @ unit @ A) for unit in E], axis=1))
        theta.append(stated_parameters(arm, heaviest))
        rest.append(whole - X[-1] @ theta[-1])
    return Links(tuple(names), np.array(theta), np.array(X), np.array(rest))


def stated_parameters(arm: Robot, link: str) -> np.ndarray:
    """Return the parameters of a link in its frame as its file states them, (10,)."""
    for element in arm.description.element.iterfind("link"):
        inertial = element.find("inertial")
        if element.get("name") != link or inertial is None:
            continue
        origin, moments = inertial.find("origin"), inertial.find("inertia")
        c, rpy = (np.array(origin.get(key).split(), float) for key in ("xyz", "rpy"))
        Ixx, Ixy, Ixz, Iyy, Iyz, Izz = (float(moments.get(k)) for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
        R, m = rotation_rpy(rpy), float(inertial.find("mass").get("value"))
        I = R @ np.array([[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]]) @ R.T  # noqa: E741
        I = I + m * (c @ c * np.eye(3) - np.outer(c, c))  # noqa: E741
        return np.array([m, *(m * c), I[0, 0], I[0, 1], I[1, 1], I[0, 2], I[1, 2], I[2, 2]])
    return np.zeros(10)


def pseudo_inertia(theta: np.ndarray) -> np.ndarray:
    """Return P, (4, 4), of parameters (10,)."""
    return np.array(_entries(theta))


def _entries(theta: Any) -> list[list[Any]]:
    """Return the entries of P of parameters (10,), numbers or expressions of cvxpy."""
    m, x, y, z, Ixx, Ixy, Iyy, Ixz, Iyz, Izz = (theta[k] for k in range(10))
    half = (Ixx + Iyy + Izz) / 2
    return [[half - Ixx, -Ixy, -Ixz, x], [-Ixy, half - Iyy, -Iyz, y], [-Ixz, -Iyz, half - Izz, z], [x, y, z, m]]


def nearest_possible(links: Links, R: np.ndarray, values: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return possible parameters of the links, (N, 10), that fit base parameters π, (r,), with their covariance.

    Raises:
        LogError: If the solver finds none.
        MissingExtraError: If cvxpy or clarabel is not installed.
    """
    cp: Any = needs("cvxpy", extra="identify")
    needs("clarabel", extra="identify")
    N, sizes = len(links.names), links.sizes
    L = np.linalg.cholesky(np.linalg.inv(covariance)).T
    A = np.einsum("rbk,bkj->rbj", R.reshape(len(R), N, 10), links.X)
    constant = R @ links.rest.ravel() - values
    x = cp.Variable((N, 10))  # in units of the sizes
    data = L @ (A.reshape(len(R), -1) * sizes.ravel()) @ cp.reshape(x, (10 * N,), order="C") + L @ constant
    objective = cp.sum_squares(data)
    for i in range(N):
        objective += cp.sum_squares(_metric(links.theta[i], sizes[i]) @ (x[i] - links.theta[i] / sizes[i])) / SPREAD**2
    possible = [cp.bmat(_entries(x[i])) >> _MARGIN * np.eye(4) for i in range(N)]
    problem = cp.Problem(cp.Minimize(objective), possible)
    try:
        problem.solve(solver=cp.CLARABEL)
    except cp.SolverError:
        x.value = None
    if x.value is None or problem.status not in ("optimal", "optimal_inaccurate"):
        raise LogError(f"no possible bodies fit the log ({problem.status}); check the arm and the units of the torques")
    return np.asarray(x.value) * sizes


def _metric(theta: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the matrix (16, 10) from a change of parameters, in units of the size, to S ΔP S."""
    least = np.array([size[0], 0, 0, 0, *[0.1 * size[4] if k in (0, 2, 5) else 0.0 for k in range(6)]])
    values, vectors = np.linalg.eigh(pseudo_inertia(theta))
    floor = np.linalg.eigvalsh(pseudo_inertia(least)).min()
    S = (vectors / np.sqrt(np.maximum(values, floor))) @ vectors.T
    return np.stack([(S @ pseudo_inertia(unit) @ S).ravel() for unit in np.diag(size)], axis=1)


def inertial_texts(theta: np.ndarray, stated: StatedLink | None = None) -> dict[str, dict[str, str]]:
    """Return the attributes of the elements of <inertial> for parameters (10,) of a link."""
    m, c = theta[0], theta[1:4] / theta[0]
    Ixx, Ixy, Iyy, Ixz, Iyz, Izz = theta[4:]
    I = np.array([[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]]) - m * (c @ c * np.eye(3) - np.outer(c, c))  # noqa: E741
    text = lambda x: f"{x:.8g}"  # noqa: E731
    return {
        "mass": {"value": text(m)},
        "origin": {"xyz": " ".join(map(text, c)), "rpy": "0 0 0"},
        "inertia": {f"i{'xyz'[i]}{'xyz'[j]}": text(I[i, j]) for i in range(3) for j in range(i, 3)},
    }
