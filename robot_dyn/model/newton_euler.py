"""Wrenches through the joints of a robot, moving and fixed, by the recursive Newton–Euler algorithm.

    F_j = Σ_l (𝓜_l V̇_l − ad_{V_l}ᵀ 𝓜_l V_l − F_gravity,l − F_external,l),   over the links l that joint j carries

F = (f, τ) is exerted by the parent link on the child link. [Featherstone 2008, ch. 5]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray
from numpy.typing import ArrayLike

from robot_dyn.description.couplings import Couplings
from robot_dyn.description.description import Description
from robot_dyn.description.edits import Edits
from robot_dyn.foundations.arithmetic import apply, transpose
from robot_dyn.foundations.errors import OverflowedError
from robot_dyn.foundations.validate import JointValues, check_batches, choice, instance, rows, shaped
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.model.calls import Scratch
from robot_dyn.model.pinocchio_model import every_joint
from robot_dyn.queries.batch import answered
from robot_dyn.queries.dynamics import Dynamics


@final
@dataclass(frozen=True, eq=False)
class JointWrenches(ReadOnly):
    """Wrenches F = (f, τ) of parent links on child links, in [N] and [N m]; `wrenches[joint]` selects one joint.

    Attributes:
        joints: Names of the k joints of the file: moving, locked and fixed, from the base to the tips.
        at_joints: Wrench through each joint, (..., k, 6).
        at_base: Wrench of the ground on the root link, (..., 6).
    """

    joints: tuple[str, ...]
    at_joints: ndarray
    at_base: ndarray

    def __getitem__(self, joint: str) -> ndarray:
        """Return the wrench through a joint, (..., 6); raise a QueryError if its name is unknown."""
        return self.at_joints[..., self.joints.index(choice("joint", joint, self.joints)), :]


@final
@dataclass(frozen=True, eq=False)
class NewtonEuler:
    """The Newton–Euler recursion through the k joints of a file and one more, which carries the root link.

    Attributes:
        model: The `pinocchio.Model` of these joints.
        couplings: Map from q to their positions, which are constant for fixed and locked joints.
        scratch: Working memory of the algorithm.
        links: The child link of each joint, preceded by the root link.
        parents: Parent of each link except the root.
    """

    model: pin.Model
    couplings: Couplings
    scratch: Scratch
    links: tuple[str, ...]
    parents: Mapping[str, str]

    @classmethod
    def from_edits(cls, description: Description, edits: Edits, joint_names: tuple[str, ...]) -> NewtonEuler:
        """Return the recursion of a description with its edits; raise a DescriptionError if it has too many joints."""
        model, couplings = every_joint(description, edits, joint_names)
        ends = {
            joint.get("name"): [joint.find(end).get("link") for end in ("child", "parent")]
            for joint in description.element.iterfind("joint")
        }
        parents = dict(ends.values())
        (root,) = {*parents.values()} - parents.keys()
        return cls(model, couplings, Scratch(model), (root, *(ends[name][0] for name in model.names[2:])), parents)

    def __call__(self, q: ndarray, v: ndarray, a: ndarray) -> ndarray:
        """Return the wrench on each of `links` at its frame, in its axes, (..., k + 1, 6)."""
        full = np.broadcast_arrays(self.couplings.position(q), self.couplings.velocity(v), self.couplings.velocity(a))
        data, answers = self.scratch.data, []
        for row in zip(*(x.reshape(-1, x.shape[-1]) for x in full), strict=True):
            pin.rnea(self.model, data, *row)
            answers.append(np.array([force.vector for force in data.f.tolist()[1:]]))  # `vector` is a view of data
        return np.array(answers).reshape(*full[0].shape, 6)

    def carrying(self, link: str) -> ndarray:
        """Return True for each joint that carries a link, (k + 1,)."""
        chain = [link]
        while chain[-1] in self.parents:
            chain.append(self.parents[chain[-1]])
        return np.isin(self.links, chain)


def joint_wrenches(
    recursion: NewtonEuler, dynamics: Dynamics[ndarray], joint_frames: Mapping[str, str],
    state: Mapping[str, JointValues], external: Mapping[str, ArrayLike] | None, frame: str | None,
    at: str | None,
) -> JointWrenches:  # fmt: skip
    """Return the wrenches at a state (q, v, a by name); for the other arguments, see `Robot.joint_wrenches`."""
    arrays = {name: shaped(name, x, dynamics.joint_names) for name, x in state.items()}
    external = {} if external is None else external
    instance("external", external, Mapping, "give wrenches by link, for example {'tool0': [0, 0, -10, 0, 0, 0]}")
    forces = {link: rows(f"external[{link!r}]", F, 6) for link, F in external.items()}
    check_batches(**arrays, **{f"external[{link!r}]": F for link, F in forces.items()})
    W = answered(recursion, arrays, (len(recursion.links), 6), dynamics.joint_names)
    if forces or frame is not None or at is not None:
        q = arrays["q"]
        R, p = _placements(dynamics, q, recursion.links)
        point = p if at is None else _placements(dynamics, q, (at,))[1]
        with np.errstate(all="ignore"):  # overflow raises an error below
            f = apply(R, W[..., :3])
            tau = apply(R, W[..., 3:]) + np.cross(p - point, f)
            for link, F in forces.items():
                force, torque = F[..., None, :3], F[..., None, 3:]
                arm = _placements(dynamics, q, (link,))[1] - point
                carries = recursion.carrying(joint_frames.get(link, link))[:, None]
                f, tau = f - carries * force, tau - carries * (torque + np.cross(arm, force))
            axes = transpose(R if frame is None else _placements(dynamics, q, (frame,))[0])
            W = np.concatenate([apply(axes, f), apply(axes, tau)], axis=-1)
        if not np.isfinite(W).all():
            raise OverflowedError("the result overflows: the external wrenches are too large")
    return JointWrenches(tuple(recursion.model.names[2:]), W[..., 1:, :], W[..., 0, :])


def _placements(dynamics: Dynamics[ndarray], q: ndarray, links: tuple[str, ...]) -> tuple[ndarray, ndarray]:
    """Return R, (..., k, 3, 3), and p, (..., k, 3), of k links in the base."""
    g = np.stack([dynamics.placement(q, link) for link in links], axis=-3)
    return g[..., :3, :3], g[..., :3, 3]
