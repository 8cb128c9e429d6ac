"""Checks of a setup: its parts fit each other and the method, and can be evaluated at the start."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.effects.plant import Plant
from robot_dyn.effects.rigid_stops import RigidStops
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import ControlError, EffectError, OverflowedError, QueryError, call, shown
from robot_dyn.foundations.validate import Kind, float64, number
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.simulation.dynamics.event import Event
from robot_dyn.simulation.setup.schedule import MOST_CUT

_UNITS = ("rad", "m")
Method = Integrator | Adaptive
Accuracy = float | Mapping[str, float]
"""A requested accuracy: one number for rad and m, or a number for each unit."""


def check_method(plant: Plant, method: Method, events: tuple[Event, ...], finds_events: bool) -> None:
    """Check that a method can integrate a plant and can locate the events.

    Raises:
        QueryError: If it cannot; names the part or event and a method that can.
    """
    if events and not finds_events:
        raise QueryError(
            f"events: steps of {method.name} cannot end at them; use method='DOP853'"
            if method.nonsmooth
            else f"events: in a run of more than {MOST_CUT} steps of {method.name}, steps cannot end at them; take"
            " longer steps, or method='DOP853'"
        )
    _check_set_valued(plant, method, finds_events)
    _check_payloads(plant, method)
    if method.nonsmooth and (drives := [*plant.equation_of_motion.drives.values()]):
        raise QueryError(f"{drives[0].name}: {method.name} cannot integrate the motors of a drive; use method='DOP853'")


def check_start(
    plant: Plant, controller: Controller | None, events: tuple[Event, ...], q0: np.ndarray, v0: np.ndarray
) -> None:  # fmt: skip
    """Check that effects, controller and events can be evaluated at the start, and that no stop is penetrated.

    Raises:
        QueryError: If the start is beyond a stop, or an event does not return a finite number.
        EffectError, ControlError: If an effect or the controller does not return one number for each joint.
    """
    check_stops(plant, q0)
    _check_torques(plant, q0, v0)
    if controller is not None:
        _check_control(controller, q0, v0)
    for event in events:
        value = call(event.function, 0.0, q0, v0)
        if np.ndim(value) or not isinstance(value, int | float | np.number) or not np.isfinite(value):
            raise QueryError(f"event {event.name!r}: its function must return a finite number, got {shown(value)}")
    no_torque = np.zeros(plant.dynamics.n)
    plant.actuation(no_torque)
    with suppress(OverflowedError):  # an overflow at the start is an outcome of the run, not a mistake
        plant.forward_dynamics(q0, v0, no_torque, t=0.0)  # a singular M is reported here


def check_model(plant: Dynamics, controller: Controller, q0: np.ndarray) -> None:
    """Check that the models of a controller have the joints of the plant, in its order, and its task frame.

    A model that shares no joint name with the plant is accepted: it may be the same arm under other names.
    """
    for model in controller.models.values():
        pairs = tuple(zip(model.joint_names, plant.joint_names, strict=False))
        if not any(name in plant.joint_names for name, _ in pairs):
            continue
        for name, plant_name in pairs:
            if name != plant_name:
                raise QueryError(
                    f"the controller's model has the joint {name!r} where the plant has {plant_name!r}; lock the same"
                    " joints in both"
                )
    if controller.task_frame is not None:
        plant.placement(q0, controller.task_frame)  # raises an error for an unknown link


def check_stops(plant: Plant, q0: Array, name: str = "q0") -> None:
    """Check that a start is not beyond a rigid stop.

    Raises:
        QueryError: If it is; names the joint, the depth and the start, which is called `name`.
    """
    for effect in plant.effects:
        if isinstance(effect, RigidStops) and (depth := effect.penetration(q0)).any():
            i = int(np.argmax(depth))
            joint, which = plant.dynamics.joint_names[i], "lower" if effect.touched(q0)[i] < 0 else "upper"
            raise QueryError(f"{name}: {joint!r} is {depth[i]:.3g} beyond its {which} stop; start between the stops")


def _check_set_valued(plant: Plant, method: Method, finds_events: bool) -> None:
    """Check that the steps of a method can end where dry friction, stops or backlash hold or release a joint."""
    effects = plant.equation_of_motion.set_valued
    for is_unsuited, reason in (
        (method.canonical, "integrates momenta"),
        (isinstance(method, Integrator) and method.order < 2, "is of order 1, too low to find where"),
        (not finds_events, f"takes more than {MOST_CUT} steps"),
    ):
        if effects and is_unsuited and not method.nonsmooth:
            raise QueryError(
                f"{effects[0].name}: steps must end where it begins or ceases to hold a joint, but {method.name}"
                f" {reason};"
                " use method='DOP853', or 'MoreauJean' with a step_s"
            )
    if method.nonsmooth and (other := [x for x in effects if not (x.has_friction or x.stops)]):
        raise QueryError(f"{other[0].name}: cannot be stepped by {method.name}; use method='DOP853'")


def _check_payloads(plant: Plant, method: Method) -> None:
    """Check that a method can continue after a payload has been picked up or dropped."""
    for is_unsuited, reason in (
        (method.canonical, f"picking up or dropping a payload changes momenta, which {method.name} integrates"),
        (method.nonsmooth, f"steps of {method.name} do not end where the payload is picked up or dropped"),
    ):
        if plant.equation_of_motion.payloads and is_unsuited:
            raise QueryError(f"carried_payload: {reason}; use method='DOP853'")


def _check_torques(plant: Plant, q0: Array, v0: Array) -> None:
    """Check that each effect returns one finite number for each joint, and for each of its states, at the start."""
    dynamics, equation = plant.dynamics, plant.equation_of_motion
    with np.errstate(all="ignore"):
        torques = equation.torques(0.0, q0, v0)
        for force, torque in zip(plant.forces, torques, strict=True):
            _check_returned(f"{type(force).__name__}.torque", torque, dynamics.n, error=EffectError)
            if any(threshold.of_actuation for threshold in force.thresholds(dynamics.n)):
                raise EffectError(f"{force.name}: only bounds may have thresholds of the actuation")
        u, z = np.zeros(dynamics.n), np.zeros(equation.state_size)
        u, reached = equation.applied(u, v0, z)
        names = (type(plant.effects[k]).__name__ for k in equation.states)
        rates = equation.state_rates(0.0, q0, v0, u, reached, z)
        for name, (place, rate) in zip(names, rates, strict=True):
            _check_returned(f"{name}.state_rate", rate, place.stop - place.start, "state", error=EffectError)


def _check_control(controller: Controller, q0: Array, v0: Array) -> None:
    """Check that the controller returns one finite number for each joint, and for each of its states, at the start."""
    with np.errstate(all="ignore"), suppress(OverflowedError):  # an overflow of its model is an outcome of the run
        start = 0.0, q0, v0, np.zeros(controller.state_size)
        torque = call(controller.torque, *start)
        _check_returned(f"{controller.name}.torque", torque, controller.n, error=ControlError)
        if controller.state_size:
            after = controller.next_state if controller.period_s else controller.state_rate
            name = f"{controller.name}.{after.__name__}"
            _check_returned(name, call(after, *start), controller.state_size, "state", error=ControlError)


def least_accuracy(accuracy: Accuracy, dynamics: Dynamics) -> float:
    """Return the requested accuracy as one number: the smallest of those for the units of the joints.

    Raises:
        QueryError: If it is not a positive number, or lacks the unit of a joint.
    """
    if not isinstance(accuracy, Mapping):
        return number("accuracy", accuracy, above=0)
    if unknown := [name for name in accuracy if name not in _UNITS]:
        raise QueryError(f"accuracy: no unit {shown(unknown[0])}; give 'rad', 'm' or both")
    kinds = getattr(getattr(dynamics, "robot", dynamics), "joint_types", None)
    slides = [None] if kinds is None else [kind == "prismatic" for kind in kinds]
    units = [unit for unit, slide in zip(_UNITS, (False, True), strict=True) if slide in slides or None in slides]
    if missing := [unit for unit in units if unit not in accuracy]:
        raise QueryError(f"accuracy: there is no value for joints in {missing[0]}, got {shown(dict(accuracy))}; add it")
    return min(number(f"accuracy in {unit}", accuracy[unit], above=0) for unit in units)


def _check_returned(name: str, values: Any, n: int, row: str = "joint", *, error: Kind) -> None:
    """Raise the error unless `values`, which the function `name` returned, are finite numbers of shape (n,)."""
    try:
        array = float64(values)
        problem = f"shape {array.shape}" if array.shape != (n,) else ""
        if not (problem or np.isfinite(array).all()):
            problem = str(array[~np.isfinite(array)][0])
    except ValueError as failure:
        problem = str(failure)
    if problem:
        count = f"{n} {row}{'s' if n > 1 else ''}"
        raise error(f"{name} returned {problem} for {count} at the start; return finite numbers of shape ({n},)")
