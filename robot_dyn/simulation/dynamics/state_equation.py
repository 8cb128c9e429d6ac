"""The state equation: the motion of a plant as a first-order system y' = f(t, y), with y = (q, v or p, z, W).

    q' = v,   v' = M⁻¹ (τ − C v − N)   or   p' = τ + Cᵀ v − N with p = M v,
    z' = rates of the states of the controller, then of the effects; then J' = λ, the reactions of stops and friction,
    W_k' = τ_kᵀ v: the work of the control and of each effect without a potential

[Murray, Li, Sastry 1994, ch. 4; Hairer, Lubich, Wanner 2006, §VI.1 for canonical coordinates]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, final

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.effects.effect import Bound, Conservative, Stateful, numbered
from robot_dyn.effects.equation_of_motion import EquationOfMotion
from robot_dyn.effects.plant import Plant, carrying, in_mode
from robot_dyn.effects.set_valued import Mode
from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.foundations.errors import EffectError, RobotDynError, call
from robot_dyn.foundations.threshold import Layer, Threshold
from robot_dyn.foundations.values import Caching
from robot_dyn.queries.dynamics import acceleration

if TYPE_CHECKING:
    from robot_dyn.simulation.dynamics.event import Event

CONTROL = "control"
PICK_UP = "pick_up"  # the work of impacts at which payloads at rest are picked up
CONTROLLER = -1  # number of the controller among the parts that switch; effects have their index


@final
@dataclass(frozen=True)
class StateEquation(Caching):
    """The state equation of a plant under a controller.

    Attributes:
        plant: The arm with the effects that act on it.
        controller: The controller, or None.
        canonical: True if the second part of y is the momentum p instead of v.
        events: User-defined events that a run detects.
    """

    plant: Plant
    controller: Controller | None
    canonical: bool = False
    events: tuple[Event, ...] = ()

    @cached_property
    def equation_of_motion(self) -> EquationOfMotion:
        """The equation of motion of the plant."""
        return self.plant.equation_of_motion

    @cached_property
    def sources(self) -> tuple[str, ...]:
        """Names of the works in y: control, then effects; the second effect of a name has a number.

        Payloads that are picked up or dropped, and the impacts at that, come last: their work jumps and has no power.
        """
        payloads = self.equation_of_motion.payloads
        impacts = [PICK_UP] * any(payload.at_rest and payload.start_s > 0 for payload in payloads)
        return numbered(CONTROL, *self._working, *(x.name for x in payloads), *impacts)

    @cached_property
    def _working(self) -> list[str]:
        """Names of the forces that have a power."""
        return [x.name for x in self.plant.forces if not isinstance(x, Conservative)]

    @cached_property
    def of_payloads(self) -> range:
        """Indices, in `sources`, of the works of payloads that are picked up or dropped."""
        first = 1 + len(self._working)
        return range(first, first + len(self.equation_of_motion.payloads))

    @cached_property
    def state_size(self) -> int:
        """Number of states of the controller."""
        return self.controller.state_size if self.controller else 0

    @cached_property
    def states(self) -> int:
        """Number of states of the controller and of the effects, and of the impulses of reactions."""
        return self.state_size + self.equation_of_motion.state_size + self.impulses

    @cached_property
    def impulses(self) -> int:
        """Number of the impulses of reactions, the last of the states: n if an effect may hold joints, else 0."""
        return self.plant.dynamics.n if self.equation_of_motion.set_valued else 0

    @cached_property
    def in_a_mode(self) -> StateEquation:
        """The equation in the mode in which no joint is held and all payloads are carried; itself without modes."""
        if payloads := [payload for payload in self.equation_of_motion.payloads if payload.carried is None]:
            return replace(self, plant=carrying(self.plant, [True] * len(payloads))).in_a_mode
        if not self.impulses:
            return self
        return replace(self, plant=in_mode(self.plant, Mode(*np.zeros((2, self.plant.dynamics.n)))))

    @property
    def size(self) -> int:
        """Number m of entries of y."""
        return 2 * self.plant.dynamics.n + self.states + len(self.sources)

    @cached_property
    def widths(self) -> np.ndarray:
        """Change of each entry of y over which the rate bends, (m,): the smallest that an effect declares, else inf."""
        n = self.plant.dynamics.n
        widths = np.full(self.size, np.inf)
        for effect in self.plant.effects:
            for part, width in zip((slice(0, n), slice(n, 2 * n)), effect.widths, strict=True):
                widths[part] = np.minimum(widths[part], width)
        return widths

    def start(self, q: Array, v: Array) -> Array:
        """Return y at the start, (m,), with the states of the effects; those of the controller and the works are 0."""
        second = self.plant.dynamics.momentum(q, v) if self.canonical else v
        y = np.concatenate([q, second, np.zeros(self.states + len(self.sources))])
        y[self._place(slice(0, self.equation_of_motion.state_size))] = self.equation_of_motion.start(q, v)
        return y

    def _place(self, states: slice) -> slice:
        """Return the entries of y with these states of effects."""
        first = 2 * self.plant.dynamics.n + self.state_size
        return slice(first + states.start, first + states.stop)

    def place_of(self, part: object) -> slice | None:
        """Return the entries of y that are the states of the controller or of an effect; None if it has none."""
        if part is self.controller:
            n = self.plant.dynamics.n
            return slice(2 * n, 2 * n + self.state_size)
        places = self.equation_of_motion.states.items()
        return next((self._place(states) for k, states in places if self.plant.effects[k] is part), None)

    def row(self, part: int | None, declared: Threshold | Layer) -> int:
        """Return the entry of y that a threshold or a layer of part `part` concerns; for None, an entry of q or v.

        Raises:
            EffectError: If it is a threshold of a state, and the part has no states.
        """
        if declared.state is None or part is None:
            return declared.joint + self.plant.dynamics.n * declared.of_velocity
        if part not in self.equation_of_motion.states:
            name = declared.name if isinstance(declared, Threshold) else "layer"
            raise EffectError(f"{name}: is a threshold of a state, and the part that declares it has none")
        return self._place(self.equation_of_motion.states[part]).start + declared.state

    def state(self, y: Array) -> tuple[Array, Array, Array, Array]:
        """Return q, v, z, W of y, with z the states of the controller, then of the effects, then the impulses."""
        n, m = self.plant.dynamics.n, self.states
        q, second = y[:n], y[n : 2 * n]
        v = acceleration(self.plant.M(q), second, self.plant.dynamics.joint_names) if self.canonical else second
        return q, v, y[2 * n : 2 * n + m], y[2 * n + m :]

    def controller_states(self, y: Array) -> Array | None:
        """Return the states of the controller in states y (k, m), (k, state_size); None if it has none."""
        n, m = self.plant.dynamics.n, self.state_size
        return y[:, 2 * n : 2 * n + m].copy() if m else None

    def effect_states(self, y: Array) -> dict[str, Array]:
        """Return the states of each effect with states in states y (k, m), (k, size), by name."""
        states = self.equation_of_motion.states
        names = numbered(*(self.plant.effects[k].name for k in states))
        return {name: y[:, self._place(place)].copy() for name, place in zip(names, states.values(), strict=True)}

    def stored(self, t: Array, y: Array) -> dict[str, Array]:
        """Return the energy stored by each effect with states, at times t (k,) and states y (k, m), (k,), by name."""
        effects = [x for x in self.plant.effects if isinstance(x, Stateful)]
        return {
            name: np.array(
                [
                    call(effect.stored_energy, self.plant.dynamics, *state)
                    for state in zip(t, y[:, : self.plant.dynamics.n], z, strict=True)
                ]
            ).reshape(len(t))
            for effect, (name, z) in zip(effects, self.effect_states(y).items(), strict=True)
        }

    def with_velocities(self, y: Array) -> Array:
        """Return states y (k, m) with velocities instead of momenta."""
        if not self.canonical:
            return y
        n, y = self.plant.dynamics.n, y.copy()
        y[:, n : 2 * n] = np.array([self.state(row)[1] for row in y]).reshape(-1, n)
        return y

    def motion(self, y: Array) -> tuple[Array, Array]:
        """Return the positions and the velocities in states y (k, m), (k, n) each."""
        n, y = self.plant.dynamics.n, self.with_velocities(y)
        return y[:, :n], y[:, n : 2 * n]

    def fastest_joint(self, y: Array) -> str:
        """Return the name of the joint with the largest |v|, or |p| if M cannot be inverted, at a state y (m,)."""
        n = self.plant.dynamics.n
        with np.errstate(all="ignore"):
            try:
                v = self.state(y)[1]
            except RobotDynError:
                v = y[n : 2 * n]
        return self.plant.dynamics.joint_names[int(np.argmax(np.abs(v)))]

    def command(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """Return the torque of the controller within the bounds that precede effects with states, (n,)."""
        if self.controller is None:
            return np.zeros_like(v)
        return self.equation_of_motion.commanded(call(self.controller.torque, t, q, v, z[: self.state_size]))

    def actuation(self, t: float, q: Array, v: Array, z: Array, held: Array | None) -> Array:
        """Return the actuation within all bounds of the plant; that of `held`, in zero-order hold, if not None."""
        u = self.command(t, q, v, z) if held is None else held
        return self.equation_of_motion.applied(u, v, z[self.state_size :])[0]

    def acceleration(self, t: float, q: Array, v: Array, z: Array, u: Array) -> Array:
        """Return the acceleration under an actuation u that is within all bounds, (n,)."""
        equation = self.equation_of_motion
        torques = equation.torques(t, q, v, z=z[self.state_size :])
        return equation.acceleration(q, v, sum(torques, start=equation.on_joints(u)))

    @property
    def sampled(self) -> bool:
        """True if the controller acts at ticks, with a zero-order hold between them."""
        return self.controller is not None and self.controller.period_s > 0

    def tick(self, t: float, y: Array) -> tuple[Array, Array | None]:
        """Return y with the next states of a sampled controller, and u; y and None for any other controller."""
        if self.controller is None or not self.sampled:
            return y, None
        q, v, z, _ = self.state(y)
        held, n = self.command(t, q, v, z), self.plant.dynamics.n
        if self.state_size:
            y = y.copy()
            y[2 * n : 2 * n + self.state_size] = call(self.controller.next_state, t, q, v, z[: self.state_size])
        return y, held

    def rate(self, t: float, y: Array, held: Array | None) -> tuple[Array, Array]:
        """Return f(t, y), (m,), and the actuation u; in floats or, for the compiled engine, in symbols.

        Args:
            t: Time, in [s].
            y: State, (m,).
            held: The actuation in zero-order hold of a sampled controller; None if it acts continuously.
        """
        equation, controller, n = self.equation_of_motion, self.controller, self.plant.dynamics.n
        q, v, z, _ = self.state(y)
        z_controller, z_effects = z[: self.state_size], z[self.state_size :]
        u, reached = equation.applied(self.command(t, q, v, z) if held is None else held, v, z_effects)
        torques = equation.torques(t, q, v, z=z_effects)
        total = sum(torques, start=equation.on_joints(u))
        result = np.empty_like(y)
        result[:n] = v
        end, W = 2 * n + self.state_size, 2 * n + self.states
        if self.impulses:
            result[n : 2 * n], result[W - n : W] = equation.with_reaction(q, v, total)
        else:
            second = equation.momentum_rate if self.canonical else equation.acceleration
            result[n : 2 * n] = second(q, v, total)
        has_rate = held is None and controller is not None and self.state_size > 0
        result[2 * n : end] = call(controller.state_rate, t, q, v, z_controller) if has_rate and controller else 0.0
        rates = result[end : end + equation.state_size]
        a = result[n : 2 * n]
        for place, rate in equation.state_rates(t, q, v, u, reached, z_effects, a):
            rates[place] = rate
        result[W:] = self._powers(v, u, torques, z_effects, a)
        return result, u

    def _powers(self, v: Array, u: Array, torques: list[Array], z: Array, a: Array) -> list[Scalar]:
        """Return the power of each source; 0 for those whose work jumps."""
        powers = self.equation_of_motion.powers(v, u, torques, z, a)
        return powers + [0.0] * (len(self.sources) - len(powers))

    @cached_property
    def limited(self) -> tuple[int, ...]:
        """Parts with thresholds of an actuation that changes between ticks: CONTROLLER, and indices of effects."""
        if self.controller is None:
            return ()
        effects, n = self.plant.effects, self.plant.dynamics.n
        numbers = self.equation_of_motion.bounds_at_all_times if self.sampled else range(len(effects))
        bounds = [k for k in numbers if isinstance(effects[k], Bound)]
        declared = {k: effects[k].thresholds(n) for k in bounds}
        if not self.sampled:
            declared = {CONTROLLER: self.controller.thresholds()} | declared
        return tuple(k for k, thresholds in declared.items() if any(x.of_actuation for x in thresholds))

    @property
    def switches(self) -> bool:
        """True if a part switches at a threshold, or there are user-defined events."""
        effects, n = self.plant.effects, self.plant.dynamics.n
        declared = [threshold for effect in effects for threshold in effect.thresholds(n)]
        if self.controller is not None and not self.sampled:
            declared += self.controller.thresholds()
        return bool(
            self.events or self.limited or self.impulses or any(not threshold.of_actuation for threshold in declared)
        )

    def demands(
        self, t: float, q: Array, v: Array, z: Array, held: Array | None, parts: tuple[int, ...]
    ) -> list[Array]:
        """Return the values of each of these parts, (n,), that its thresholds limit; see `limited`."""
        if not parts or self.controller is None:
            return []
        state, equation = (t, q, v, z[: self.state_size]), self.equation_of_motion
        whole = range(len(equation.effects))
        u, bounds = (call(self.controller.torque, *state), whole) if held is None else (held, None)
        reached = equation.applied(u, v, z[self.state_size :], bounds)[1]
        effects: Any = equation.effects
        return [
            call(self.controller.demand, *state) if k == CONTROLLER else call(effects[k].limited, reached[k], v)
            for k in parts
        ]

    def switching(self, t: float, q: Array, v: Array) -> list[float | np.floating]:
        """Return the values of the user-defined events, in floats or symbols."""
        return [call(event.function, t, q, v) for event in self.events]

    def bodies(self, t: float, y: Array, held: Array | None) -> Array:
        """Return the data of the convex problems at events: M by rows, load and u_m, (n² + n + motors,).

            load = τ + Σ τ_effect − C v − ∂V/∂q,   u_m = u − b θ̇ of each motor in a rigid backlash

        The mode is one in which no motor rests; the numbers are floats or symbols. See `rate` for the arguments.
        """
        motion, n, (q, v, z, _) = self.equation_of_motion, self.plant.dynamics.n, self.state(y)
        u, z_effects = self.actuation(t, q, v, z, held), z[self.state_size :]
        torques = motion.torques(t, q, v, z=z_effects)
        load = sum(torques, start=motion.on_joints(u)) - self.plant.dynamics.inverse_dynamics(q, v, 0 * v)
        coupled: dict[int, Any] = {k: drive for k, drive in motion.drives.items() if drive.coupled}
        motors = [u[list(x.driven(n))] - x.drag(n, z_effects[motion.states[k]]) for k, x in coupled.items()]
        return np.concatenate([self.plant.M(q).ravel(), load, *motors])

    def event_values(self, t: float, y: Array, held: Array | None) -> Array:
        """Return the torques that reach the limited parts, (n,) each, then the values of events, (G,), at y (m,)."""
        q, v, z, _ = self.state(y)
        demands = self.demands(t, q, v, z, held, self.limited)
        return np.array([*np.ravel(demands), *self.switching(t, q, v)], dtype=float)

    def energies(self, t: Scalar, q: Array, v: Array) -> tuple[Array, Array]:
        """Return K, and V of gravity and of all conservative effects, in [J], of samples q, v (k, n), (k,)."""
        return self.equation_of_motion.energies(t, q, v)

    def powers(self, t: float, q: Array, v: Array, z: Array, u: Array) -> list[Scalar]:
        """Return the power of each source, in [W], in the order of `sources`; 0 for those whose work jumps."""
        z_effects = z[self.state_size :]
        return self._powers(v, u, self.equation_of_motion.torques(t, q, v, z=z_effects), z_effects, 0 * v)
