"""Base classes of controllers, τ = τ(t, q, v, z) with optional states ż = rate(t, q, v, z); `ControlLaw`.

The states z of a continuous controller (`period_s` 0) are integrated with the plant. A sampled controller updates
z⁺ = z + period · rate at its ticks and keeps its torque constant between them (zero-order hold).
[Siciliano et al. 2009, ch. 8]
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from inspect import signature
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, final

import numpy as np

from robot_dyn.control.reference import Reference
from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.foundations.coefficients import check_coefficients, declared, with_values
from robot_dyn.foundations.errors import ControlError, shown
from robot_dyn.foundations.threshold import Threshold, smooth
from robot_dyn.foundations.validate import duration
from robot_dyn.foundations.values import Value
from robot_dyn.queries.dynamics import Dynamics

if TYPE_CHECKING:
    from robot_dyn.control.digital_loop.block import Block


class Nested(NamedTuple):
    """A part of a composite controller.

    Attributes:
        path: Path of the attribute, such as "controller" or "position.0".
        label: Prefix of its coefficients in sweeps, such as "position.quantisation.".
        part: A controller or a block.
    """

    path: str
    label: str
    part: Controller | Block


class Controller(Value, ABC):
    """A control law τ = τ(t, q, v, z) with controller states, ż = rate(t, q, v, z), z(0) = 0.

    Subclass `Stateless` if it has no states. Otherwise define

        def torque(self, t, q, v, z): ...              # (n,), in [N m] or [N]
        def state_rate(self, t, q, v, z): ...          # ż, (state_size,), in the unit of z per second

    and the properties `n` and `state_size`. A sampled law that is written from tick to tick, such as an observer,
    defines next_state(self, t, q, v, z) instead of state_rate: z⁺ after the tick at t, (state_size,). All methods
    are pure functions, called with

        t: time, a number, in [s]
        q: position, (n,), in [rad] or [m] by joint
        v: velocity, (n,), in [rad/s] or [m/s]
        z: controller states, (state_size,)

    and with symbols instead of numbers when it is compiled. Methods that use only `robot_dyn.foundations.arithmetic`
    and NumPy's operators run in both engines. Attributes may be references, models of the arm and numbers, under any
    names. Declared coefficients (`robot_dyn.foundations.coefficients`) are checked on construction and may be swept.

    Attributes:
        term: The law u = … in short form, for `explain`.
        period_s: Time between samples in [s], with the torque constant between them; 0 for continuous control.
    """

    term: ClassVar[str] = ""
    outermost: ClassVar[bool] = False  # True if it must not be part of another controller
    period_s: float = 0.0

    def __post_init__(self) -> None:
        check_coefficients(self, ControlError)
        check_joints(self, self.n)
        object.__setattr__(self, "period_s", duration("period_s", self.period_s, zero=True, error=ControlError))

    @property
    def name(self) -> str:
        """Name in messages: the name of the class."""
        return type(self).__name__

    @property
    def parts(self) -> tuple[Nested, ...]:
        """The controllers and blocks inside it, including nested ones; () for a plain control law."""
        return ()

    @property
    def references(self) -> dict[str, Reference]:
        """The references, by attribute or path."""
        return {name: value for name, value in self._attributes() if isinstance(value, Reference)}

    @property
    def models(self) -> dict[str, Dynamics]:
        """The models of the arm, by attribute or path."""
        return {name: value for name, value in self._attributes() if isinstance(value, Dynamics)}

    def _attributes(self) -> Iterator[tuple[str, Any]]:
        """Yield the attributes, and by path the attributes of nested controllers."""
        yield from vars(self).items()
        for path, _, part in self.parts:
            if isinstance(part, Controller):
                yield from ((f"{path}.{name}", value) for name, value in vars(part).items())

    @property
    def desired(self) -> Reference | None:
        """The reference that a run is compared with: the first, or None if there is none."""
        return next(iter(self.references.values()), None)

    @property
    def task_frame(self) -> str | None:
        """The link whose motion is controlled; None if the controller controls the joints."""
        return None

    @property
    def saturation(self) -> Scalar:
        """Largest torque that it commands, a scalar or (n,), in [N m] or [N]; inf without a limit."""
        return np.inf

    def thresholds(self) -> tuple[Threshold, ...]:
        """Return the levels of `demand` at which it switches between smooth formulas; () if it is smooth everywhere.

        If a class does not define this method, its smoothness is unknown; see `Effect.thresholds`. In continuous
        control, integration steps end where a level is passed.
        """
        return ()

    def on_side(self, sides: Mapping[Threshold, int]) -> Controller:
        """Return the controller with each threshold passed (1) or not (−1), extended smoothly to all q, v, z."""
        return self

    def demand(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """Return the torque before its limit, (n,), in [N m] or [N]; by default the torque itself."""
        return self.torque(t, q, v, z)

    @property
    @abstractmethod
    def n(self) -> int:
        """Number of driven joints."""

    @property
    @abstractmethod
    def state_size(self) -> int:
        """Number of controller states z, which start at zero."""

    @property
    def knots(self) -> tuple[float, ...]:
        """Times in [s] at which a reference changes to another polynomial: integration steps end there."""
        return tuple(sorted({t for reference in self.references.values() for t in reference.knots.tolist()}))

    @abstractmethod
    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """Return the commanded torque, shape (n,), in [N m] or [N]."""

    def state_rate(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """Return the rate ż of the controller states, shape (state_size,), in the unit of z per [s].

        If the class defines only `next_state`, this is the mean rate over a period, (z⁺ − z) / period.

        Raises:
            ControlError: If the class defines neither method, or only `next_state` without a period.
        """
        if not self._has_only_next_state:
            raise ControlError(f"{self.name} has states; define state_rate(t, q, v, z), or next_state and a period_s")
        if not self.period_s:
            raise ControlError(f"{self.name} defines only next_state, so it is a sampled law; give it a period_s")
        return (self.next_state(t, q, v, z) - z) / self.period_s

    @property
    def _has_only_next_state(self) -> bool:
        """True if the states are defined by `next_state` only."""
        own = type(self)
        return own.state_rate is Controller.state_rate and own.next_state is not Controller.next_state

    def next_state(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """Return the states of a sampled controller after its tick at t: z⁺ = z + period · ż, shape (state_size,)."""
        return z + self.period_s * self.state_rate(t, q, v, z)

    @property
    def instants(self) -> tuple[float, ...]:
        """Times of the ticks in a period, as fractions of the period; the first is 0."""
        return (0.0,)

    @property
    def acting_instant(self) -> int:
        """Index of the instant at which the torque changes."""
        return 0

    @property
    def cycle(self) -> int:
        """Number of periods after which the ticks repeat."""
        return 1

    @property
    def deviates(self) -> int:
        """Number of states at the end of z that are standard normal deviates, redrawn before each tick."""
        return 0

    @property
    def noise_key(self) -> tuple[int, int]:
        """Seed and number of the run, which determine the deviates."""
        return 0, 0

    def of_run(self, run: int) -> Controller:
        """Return the controller for a run of a batch, by its number, with independent noise."""
        return self

    def at_period(self, period_s: float) -> Controller:
        """Return the controller with another period, in [s]; 0 for continuous control.

        A sampled law that defines only `next_state` has no continuous form and keeps its period.
        """
        if not period_s and self._has_only_next_state:
            return self
        return with_values(self, {"period_s": period_s})

    def small_signal(self) -> Controller:
        """Return the controller linearised for small signals, for example without rounding."""
        return self

    def settled(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """Return the sampled controller's states after a motion at constant velocity, from continuous states z."""
        return z


class Stateless(Controller):
    """A controller without states: τ = τ(t, q, v); z is empty.

    To write one, define

        def torque(self, t, q, v, z): ...              # (n,), in [N m] or [N]
        def thresholds(self): ...                      # () if it is smooth everywhere

    and the property `n`, the number of joints. Contract: see `Controller`. A declared gain can be swept:

        @dataclass(frozen=True)
        class Damped(rd.control.Stateless):
            arm: rd.Robot
            damping: float = field(metadata=rd.effects.coefficient("N m s/rad", minimum=0))
            n = property(lambda self: self.arm.n)

            def torque(self, t, q, v, z):
                return self.arm.N(q) - self.damping * v

            def thresholds(self):
                return ()
    """

    @property
    def state_size(self) -> int:
        return 0

    def state_rate(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return z


class Enclosing(Controller):
    """A sampled controller around another one, its attribute `controller`."""

    controller: Controller
    thresholds = smooth  # a sampled controller's torque is constant between ticks

    @property
    def term(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.controller.term

    @property
    def parts(self) -> tuple[Nested, ...]:
        return nested(self, "controller", "")

    @property
    def task_frame(self) -> str | None:
        return self.controller.task_frame

    @property
    def saturation(self) -> Scalar:
        return self.controller.saturation

    @property
    def cycle(self) -> int:
        return self.controller.cycle


def check_model(model: object) -> None:
    """Raise a ControlError unless the model is the dynamics of an arm."""
    if not isinstance(model, Dynamics):
        raise ControlError(f"model must be a robot, such as rd.load('ur5'), got {shown(model)}")


def check_joints(part: object, n: int, where: str = "") -> None:
    """Raise a ControlError if a coefficient per joint is neither a scalar nor of shape (n,)."""
    for name, declared_as in declared(type(part)).items():
        shape = np.shape(getattr(part, name))
        if declared_as.is_per_joint and shape not in ((), (n,)):
            raise ControlError(f"{where}{name} must be one number or of shape ({n},), got {shape}")


def check_sampled(name: str, controller: object) -> None:
    """Raise a ControlError unless the controller is sampled and may be nested."""
    if not isinstance(controller, Controller):
        raise ControlError(
            f"{name} must be a controller, such as rd.control.PD(…, period_s=1e-3), got {shown(controller)}"
        )
    if controller.outermost:
        raise ControlError(
            f"{name} must not be a {type(controller).__name__}; pass its inner controller, and put the loop around the"
            " outermost controller"
        )
    if not controller.period_s > 0:
        raise ControlError(f"{name} is continuous, but a loop is sampled; give {controller.name} a period_s")


def nested(controller: Controller, attribute: str, label: str) -> tuple[Nested, ...]:
    """Return a controller that is an attribute of another one, and its parts."""
    part: Controller = getattr(controller, attribute)
    below = (Nested(f"{attribute}.{path}", f"{label}{inner}", x) for path, inner, x in part.parts)
    return Nested(attribute, label, part), *below


@final
@dataclass(frozen=True, eq=False)
class ControlLaw(Stateless):
    """A function (t, q, v) → τ as a continuous controller.

    A model of the arm inside a function cannot be traced; make it an attribute of a `Stateless` controller.

    Attributes:
        function: Function that returns the torque of each joint, shape (n,), in [N m] or [N].
        joints: Number of joints n.

    Raises:
        ControlError: If the function does not take three arguments.
    """

    function: Callable[[float, Array, Array], object]
    joints: int

    def __post_init__(self) -> None:
        super().__post_init__()
        with suppress(ValueError):  # the arguments of some functions written in C are unknown
            parameters = signature(self.function)
            try:
                parameters.bind(0.0, None, None)
            except TypeError:
                raise ControlError(f"controller {self.name}{parameters}: give a function of (t, q, v)") from None

    @property
    def name(self) -> str:
        return getattr(self.function, "__name__", type(self.function).__name__)

    @property
    def term(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        return f"{self.name}(t, q, v)"

    @property
    def n(self) -> int:
        return self.joints

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return np.asarray(self.function(t, q, v))
