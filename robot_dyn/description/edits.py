"""Edits of a robot: gravity, locked joints, payloads, armature, masses; each implementation applies them itself."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, TypedDict, Unpack, final

import numpy as np

from robot_dyn.description.inertia import implausibility
from robot_dyn.description.urdf import LARGEST
from robot_dyn.foundations.errors import EditError, nearest, shown
from robot_dyn.foundations.signatures import takes, unchanged
from robot_dyn.foundations.validate import instance, numbers
from robot_dyn.foundations.values import several

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from robot_dyn.foundations.coefficients import CoefficientInput


STANDARD_GRAVITY = (0.0, 0.0, -9.80665)  # [m/s²], CGPM 1901

Matrix3 = tuple[tuple[float, float, float], ...]


@final
@dataclass(frozen=True)
class Payload:
    """A rigid body fastened to a frame of the robot.

    Attributes:
        frame: Link that carries it.
        mass: Mass in [kg], not negative.
        com: Centre of mass in the frame, shape (3,), in [m].
        inertia: Rotational inertia about its centre of mass, along the axes of the frame, shape (3, 3), in [kg m²].
    """

    frame: str
    mass: float
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)
    inertia: Matrix3 = ((0.0, 0.0, 0.0),) * 3

    def __post_init__(self) -> None:
        instance("payload frame", self.frame, str, "give the name of a link", error=EditError)
        inertia = _numbers("payload inertia", self.inertia, (3, 3))
        if not np.array_equal(inertia, inertia.T):
            raise EditError(f"payload inertia must be symmetric, got {inertia.tolist()}")
        mass = float(_numbers("payload mass", self.mass, (), least=0))
        object.__setattr__(self, "mass", mass)
        object.__setattr__(self, "com", tuple(_numbers("payload com", self.com, (3,)).tolist()))
        object.__setattr__(self, "inertia", tuple(map(tuple, inertia.tolist())))


class Changes(TypedDict, total=False):
    """Keyword arguments of `Robot.with_`."""

    gravity: ArrayLike
    lock: Mapping[str, float]
    payload: Payload | Iterable[Payload]
    armature: CoefficientInput
    mass_scale: float
    mass_scales: Mapping[str, float]
    masses: Mapping[str, float]
    inertias: Mapping[str, ArrayLike]


takes_changes = takes(unchanged(Changes.__annotations__))
"""A decorator that shows the fields of `Changes` in a signature instead of `**changes`."""


@final
@dataclass(frozen=True)
class Edits:
    """All edits of a description.

    Attributes:
        gravity: Acceleration of free fall in base axes, in [m/s²].
        lock: Locked joints, as pairs (name, value in [rad] or [m]).
        payloads: Bodies fastened to links.
        armature: Inertia of the drives reflected to the joints, as pairs (name, value in [kg m²] or [kg]).
        mass_scale: Factor on the mass and inertia of all links, but not of payloads; for deliberately wrong models.
        mass_scales: Factors on the mass and inertia of single links, as pairs (link, factor): a body of the same shape
            and another density. They multiply the values of the file or of the next two edits, and `mass_scale`.
        masses: Masses that replace those of the file, as pairs (link, value in [kg]); moments of inertia stay.
        inertias: Inertias that replace those of the file, about the centre of mass along the axes of the link's
            inertial frame, as pairs (link, (3, 3) in [kg m²]).
    """

    gravity: tuple[float, float, float] = STANDARD_GRAVITY
    lock: tuple[tuple[str, float], ...] = ()
    payloads: tuple[Payload, ...] = ()
    armature: tuple[tuple[str, float], ...] = ()
    mass_scale: float = 1.0
    mass_scales: tuple[tuple[str, float], ...] = ()
    masses: tuple[tuple[str, float], ...] = ()
    inertias: tuple[tuple[str, Matrix3], ...] = ()

    def with_(self, joint_names: tuple[str, ...], **changes: Unpack[Changes]) -> Edits:
        """Return these edits with changes, see `Robot.with_`; `joint_names` are the joints that can be named."""
        for name in changes:
            if name not in Changes.__annotations__:
                raise EditError(f"no edit {name!r}; {nearest(name, Changes.__annotations__)}")
        new = self
        if "gravity" in changes:
            gravity = changes["gravity"]
            new = replace(new, gravity=tuple(_numbers("gravity", gravity, (3,)).tolist()))
        if "armature" in changes:
            armature = changes["armature"]
            new = replace(new, armature=tuple(by_joint("armature", armature, joint_names).items()))
        if "lock" in changes:
            lock = changes["lock"]
            if not isinstance(lock, Mapping):
                raise EditError(
                    f"lock must map joint names to values, for example {{{joint_names[0]!r}: 0.0}}, got {shown(lock)}"
                )
            new = replace(new, lock=new.lock + tuple(by_joint("lock", lock, joint_names).items()))
        if "payload" in changes:
            payload = changes["payload"]
            more = (payload,) if isinstance(payload, Payload) else several(payload)
            if more is None or not all(isinstance(body, Payload) for body in more):
                raise EditError(f"payload must be a Payload or several, got {shown(payload)}")
            new = replace(new, payloads=new.payloads + more)
        if "mass_scale" in changes:
            mass_scale = changes["mass_scale"]
            factor = float(_numbers("mass_scale", mass_scale, (), above=0))
            new = replace(new, mass_scale=factor)
        for key, what in (("mass_scales", "mass_scale"), ("masses", "mass")):
            if key in changes:
                values = {
                    link: float(_numbers(f"{what} of {link!r}", x, (), above=0))
                    for link, x in _by_link(key, changes[key])
                }
                new = replace(new, **{key: tuple((dict(getattr(new, key)) | values).items())})
        if "inertias" in changes:
            inertias = {link: _inertia(link, x) for link, x in _by_link("inertias", changes["inertias"])}
            new = replace(new, inertias=tuple((dict(new.inertias) | inertias).items()))
        return new

    def as_json(self) -> str:
        """Return these edits as JSON, for run files."""
        return json.dumps(asdict(self))


def by_joint(name_of_value: str, values: CoefficientInput, joint_names: tuple[str, ...]) -> dict[str, float]:
    """Return values by joint name from a scalar, an array (n,) or a mapping, which may omit joints.

    Raises:
        EditError: If a joint is unknown, or a value is not a finite number; armature must not be negative.
    """
    if not isinstance(values, Mapping):
        n = len(joint_names)
        array = _numbers(name_of_value, values, (), (n,))
        values = dict(zip(joint_names, np.broadcast_to(array, (n,)).tolist(), strict=True))
    least, checked = 0 if name_of_value == "armature" else None, {}
    for name, value in values.items():
        if name not in joint_names:
            raise EditError(f"{name_of_value}: no free joint {name!r}; {nearest(str(name), joint_names)}")
        checked[name] = float(_numbers(f"{name_of_value} of {name!r}", value, (), least=least))
    return checked


def _by_link(what: str, values: Any) -> Iterable[tuple[str, Any]]:
    if not isinstance(values, Mapping) or not all(isinstance(link, str) for link in values):
        raise EditError(f"{what} must map link names to values, for example {{'panda_link3': …}}, got {shown(values)}")
    return values.items()


def _inertia(link: str, values: Any) -> Matrix3:
    inertia = _numbers(f"inertia of {link!r}", values, (3, 3))
    if not np.array_equal(inertia, inertia.T):
        raise EditError(f"inertia of {link!r} must be symmetric, got {inertia.tolist()}")
    if why := implausibility(0.0, np.zeros(3), inertia):
        raise EditError(f"inertia of {link!r} is not physical: {why}")
    return tuple(map(tuple, inertia.tolist()))


def _numbers(
    what: str, values: Any, *shapes: tuple[int, ...], least: float | None = None, above: float | None = None
) -> np.ndarray:
    array = numbers(what, values, *shapes, error=EditError, least=least, above=above)
    if (np.abs(array) > LARGEST).any():
        raise EditError(f"{what} is beyond ±{LARGEST:g} in SI units, got {shown(values)}; correct it")
    return array
