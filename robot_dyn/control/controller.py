"""What a controller is: τ = τ(t, q, v, z), with states ż = rate(t, q, v, z) where it needs some.

The controller states z are states like q and v: a continuous controller (`period_s` 0) has them integrated with the
plant, a sampled one takes z⁺ = z + period · rate at its ticks and keeps its torque between them (zero-order hold).
[Siciliano et al. 2009, ch. 8]
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.coefficients import check_coefficients, declared, with_values
from robot_dyn.control.reference import Reference
from robot_dyn.errors import ControlError, shown
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.threshold import Threshold
from robot_dyn.validate import duration
from robot_dyn.values import Value


class Nested(NamedTuple):
    """A part of a controller that is made of others.

    Attributes:
        path: Where it is, as "controller" or "position.0".
        label: What its coefficients begin with in sweeps, as "position.quantisation.".
        part: A controller or a block.
    """

    path: str
    label: str
    part: Any


class Controller(Value, ABC):
    """A control law τ = τ(t, q, v, z) with controller states, ż = rate(t, q, v, z), z(0) = 0.

    Subclass `Stateless` if it has no states. Its methods are pure functions, called with

        t: time, a number, in [s]
        q: position, (n,), in [rad] or [m] by joint
        v: velocity, (n,), in [rad/s] or [m/s]
        z: controller states, (state_size,)

    and with symbols in place of these numbers where it is compiled: written in `robot_dyn.arithmetic` and NumPy's
    operators it runs in both engines. Its attributes may be references, models of the arm and numbers, whatever they
    are called; those that are declared (`robot_dyn.coefficients`) are checked when it is made, and may be swept.

    Attributes:
        period_s: Time between samples in [s], with the torque constant between them; 0 for continuous control.
    """

    outermost: ClassVar[bool] = False  # whether it may not be part of another controller
    period_s: float = 0.0

    def __post_init__(self) -> None:
        check_coefficients(self, ControlError)
        check_joints(self, self.n)
        object.__setattr__(self, "period_s", duration("period_s", self.period_s, zero=True, error=ControlError))

    @property
    def name(self) -> str:
        """Its name in messages: that of its class."""
        return type(self).__name__

    @property
    def parts(self) -> tuple[Nested, ...]:
        """Controllers and blocks that it is made of, those in these among them; none for a control law."""
        return ()

    @property
    def references(self) -> dict[str, Reference]:
        """What it follows, by attribute, or by path."""
        return {name: value for name, value in self._attributes() if isinstance(value, Reference)}

    @property
    def models(self) -> dict[str, Dynamics]:
        """Its own models of the arm, by attribute, or by path."""
        others = np.ndarray, float, int, str, Reference, tuple, dict, Controller, type(None)
        return {  # a protocol takes longer to ask for
            name: value
            for name, value in self._attributes()
            if not isinstance(value, others) and isinstance(value, Dynamics)
        }

    def _attributes(self) -> Iterator[tuple[str, Any]]:
        """Its attributes, and those of controllers in it by path."""
        yield from vars(self).items()
        for path, _, part in self.parts:
            if isinstance(part, Controller):
                yield from ((f"{path}.{name}", value) for name, value in vars(part).items())

    @property
    def desired(self) -> Reference | None:
        """What a run is compared with: the first of its references; None without."""
        return next(iter(self.references.values()), None)

    @property
    def task_frame(self) -> str | None:
        """The link whose motion is desired; None if it is that of the joints."""
        return None

    @property
    def saturation(self) -> Array:
        """Greatest torque that it asks for, a scalar or (n,), in [N m] or [N]; inf where nothing limits it."""
        return np.inf

    def thresholds(self) -> tuple[Threshold, ...]:
        """Levels of its `demand`, where its formulas pass from one smooth one to another; `on_side` says to which.

        () if they are smooth everywhere; a class that does not define this declares nothing, as of `Effect`.
        Where it acts continuously, steps of integration end where one is passed.
        """
        return ()

    def on_side(self, sides: Mapping[Threshold, int]) -> Controller:
        """The controller as it is with each threshold passed (1) or not (−1), smooth wherever q, v and z are."""
        return self

    def demand(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """What it would ask for without a limit, (n,), in [N m] or [N]; its torque unless it limits that itself."""
        return self.torque(t, q, v, z)

    @property
    @abstractmethod
    def n(self) -> int:
        """Number of joints it drives."""

    @property
    @abstractmethod
    def state_size(self) -> int:
        """Number of controller states z, which start at zero."""

    @property
    def knots(self) -> tuple[float, ...]:
        """Times in [s] at which a reference passes to another polynomial: a step of integration ends there."""
        return tuple(sorted({t for each in self.references.values() for t in each.knots.tolist()}))

    @abstractmethod
    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """Torque it asks of the joints, shape (n,), in [N m] or [N]."""

    @abstractmethod
    def state_rate(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """Rate ż of the controller states, shape (state_size,), in the unit of z per [s]."""

    def next_state(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """States of a sampled controller after its tick at t: z⁺ = z + period · ż, shape (state_size,)."""
        return z + self.period_s * self.state_rate(t, q, v, z)

    @property
    def instants(self) -> tuple[float, ...]:
        """When it has its ticks, in each period, as parts of it: the first is 0."""
        return (0.0,)

    @property
    def acting_instant(self) -> int:
        """Number of the instant at which its torque changes."""
        return 0

    @property
    def cycle(self) -> int:
        """Number of periods after which it does the same again."""
        return 1

    @property
    def deviates(self) -> int:
        """Number of its last states that are standard normal deviates, drawn anew before each tick."""
        return 0

    @property
    def noise_key(self) -> tuple[int, int]:
        """Seed and number of the run, of which these deviates are."""
        return 0, 0

    def of_run(self, run: int) -> Controller:
        """The controller of the run of that number of a batch, with noise of its own."""
        return self

    def at_period(self, period_s: float) -> Controller:
        """The controller with another period, in [s]; with 0 the continuous one."""
        return with_values(self, {"period_s": period_s})

    def small_signal(self) -> Controller:
        """The controller without what small signals do not show, as rounding."""
        return self

    def settled(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """States of the sampled controller behind a motion of constant velocity, of those z of the continuous one."""
        return z


class Stateless(Controller):
    """A controller without states of its own: τ = τ(t, q, v); z is empty. Contract as of `Controller`."""

    @property
    def state_size(self) -> int:
        return 0

    def state_rate(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return z


def check_model(model: Any) -> None:
    """ControlError if it is not the dynamics of an arm."""
    if isinstance(model, type) or not isinstance(model, Dynamics):
        raise ControlError(f"model: give a robot, such as rd.load('ur5'), got {shown(model)}")


def check_joints(part: Any, n: int, where: str = "") -> None:
    """ControlError if a coefficient of joints is neither one number nor one for each of n joints."""
    for name, each in declared(type(part)).items():
        shape = np.shape(getattr(part, name))
        if each.of_joints and shape not in ((), (n,)):
            raise ControlError(f"{where}{name} must be one number or of shape ({n},), got {shape}")


def check_sampled(name: str, controller: Any) -> None:
    """ControlError if it is not a sampled controller that a loop may hold."""
    if not isinstance(controller, Controller):
        raise ControlError(f"{name} must be a controller, such as rd.PD(…, period_s=1e-3), got {shown(controller)}")
    if controller.outermost:
        raise ControlError(
            f"{name} must not be a {type(controller).__name__}: give the controller in it, and put the loop around all"
        )
    if not controller.period_s > 0:
        raise ControlError(f"{name} acts continuously, and a loop samples: give {controller.name} a period_s")


def nested(of: Controller, attribute: str, label: str) -> tuple[Nested, ...]:
    """A controller that is an attribute of another, and what is in it."""
    part: Controller = getattr(of, attribute)
    below = (Nested(f"{attribute}.{path}", f"{label}{inner}", each) for path, inner, each in part.parts)
    return Nested(attribute, label, part), *below
