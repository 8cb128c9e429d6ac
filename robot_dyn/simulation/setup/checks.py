"""Checks of a setup: that its parts fit each other and the method, and have an answer at the start."""

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
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.simulation.dynamics.event import Event
from robot_dyn.simulation.setup.schedule import MOST_CUT

_UNITS = ("rad", "m")


def check_method(plant: Plant, method: Any, events: tuple[Event, ...], finds_events: bool) -> None:
    """Check that a method can integrate what moves, and find events.

    Raises:
        QueryError: If the method cannot.
    """
    if events and not finds_events:
        raise QueryError(
            f"events: steps of {method.name} are not cut; take method='DOP853'"
            if method.nonsmooth
            else f"events: runs of more than {MOST_CUT} steps of {method.name} are not cut; take longer"
            " steps, or method='DOP853'"
        )
    _check_set_valued(plant, method, finds_events)
    _check_payloads(plant, method)
    if method.nonsmooth and (drives := [*plant.equation_of_motion.drives.values()]):
        raise QueryError(f"{drives[0].name}: {method.name} takes no motors of a drive; take method='DOP853'")


def check_start(
    plant: Plant, controller: Controller | None, events: tuple[Event, ...], q0: np.ndarray, v0: np.ndarray
) -> None:  # fmt: skip
    """Check that effects, controller and events have an answer at the start, between rigid stops.

    Raises:
        QueryError: If the start is beyond a stop, or an event returns no number.
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
    nothing = np.zeros(plant.dynamics.n)
    plant.actuation(nothing)
    with suppress(OverflowedError):  # a start so far out is the outcome of a run
        plant.forward_dynamics(q0, v0, nothing, t=0.0)  # a singular M is reported here


def check_model(plant: Dynamics, controller: Controller, q0: np.ndarray) -> None:
    """Check that a controller means the joints and links of the plant; a file with only other names may fit too."""
    for model in controller.models.values():
        pairs = tuple(zip(model.joint_names, plant.joint_names, strict=False))
        if not any(of_model in plant.joint_names for of_model, _ in pairs):
            continue
        for of_model, name in pairs:
            if of_model != name:
                raise QueryError(
                    f"the controller's model has the joint {of_model!r} where the plant has {name!r}; lock the same"
                    " joints of both"
                )
    if controller.task_frame is not None:
        plant.placement(q0, controller.task_frame)  # so that an unknown link is reported here


def check_stops(plant: Plant, q0: Array, of: str = "q0") -> None:
    """Check that a start is not beyond a rigid stop.

    Raises:
        QueryError: If it is; names the joint, and by `of` the start.
    """
    for each in plant.effects:
        if isinstance(each, RigidStops) and (depth := each.penetration(q0)).any():
            i = int(np.argmax(depth))
            name, which = plant.dynamics.joint_names[i], "lower" if each.touched(q0)[i] < 0 else "upper"
            raise QueryError(f"{of}: {name!r} is {depth[i]:.3g} beyond its {which} stop; start between the stops")


def _check_set_valued(plant: Plant, method: Any, finds_events: bool) -> None:
    """Check that steps can end where joints are held and let go."""
    effects = plant.equation_of_motion.set_valued
    for fails, why in (
        (method.canonical, "integrates momenta"),
        (not method.controls_error and method.order < 2, "is of order 1, too low to find where"),
        (not finds_events, f"takes more than {MOST_CUT} steps"),
    ):
        if effects and fails and not method.nonsmooth:
            raise QueryError(
                f"{effects[0].name}: steps must end where it holds a joint or lets it go, and {method.name} {why};"
                " take method='DOP853', or 'MoreauJean' with a step_s"
            )
    if method.nonsmooth and (other := [x for x in effects if not (x.rubs or x.stops)]):
        raise QueryError(f"{other[0].name}: has no law for {method.name}; take method='DOP853'")


def _check_payloads(plant: Plant, method: Any) -> None:
    """Check that the state is one of velocities where payloads come and go."""
    for fails, why in (
        (method.canonical, f"what is picked up or dropped changes momenta, which {method.name} integrates"),
        (method.nonsmooth, f"steps of {method.name} do not end where it comes and goes"),
    ):
        if plant.equation_of_motion.payloads and fails:
            raise QueryError(f"carried_payload: {why}; take method='DOP853'")


def _check_torques(plant: Plant, q0: Array, v0: Array) -> None:
    """Check that what each effect returns at the start is one number for each joint."""
    dynamics, equation = plant.dynamics, plant.equation_of_motion
    with np.errstate(all="ignore"):
        torques = equation.torques(0.0, q0, v0)
        for force, torque in zip(plant.forces, torques, strict=True):
            _check_returned(f"{type(force).__name__}.torque", torque, dynamics.n, error=EffectError)
            if any(each.of_actuation for each in force.thresholds(dynamics.n)):
                raise EffectError(f"{force.name}: thresholds of the actuation are for bounds")
        u, z = np.zeros(dynamics.n), np.zeros(equation.state_size)
        u, reached = equation.applied(u, z)
        names = (type(plant.effects[k]).__name__ for k in equation.states)
        rates = equation.state_rates(0.0, q0, v0, u, reached, z)
        for name, (place, rate) in zip(names, rates, strict=True):
            _check_returned(f"{name}.state_rate", rate, place.stop - place.start, "state", error=EffectError)


def _check_control(controller: Controller, q0: Array, v0: Array) -> None:
    """Check that what the controller returns at the start is one number for each joint, and for each of its states."""
    with np.errstate(all="ignore"), suppress(OverflowedError):  # of its model: the outcome of a run
        start = 0.0, q0, v0, np.zeros(controller.state_size)
        torque = call(controller.torque, *start)
        _check_returned(f"{controller.name}.torque", torque, controller.n, error=ControlError)
        if controller.state_size:
            after = controller.next_state if controller.period_s else controller.state_rate
            what = f"{controller.name}.{after.__name__}"
            _check_returned(what, call(after, *start), controller.state_size, "state", error=ControlError)


def least_accuracy(given: Any, dynamics: Dynamics) -> float:
    """Return the requested accuracy as one number: the least of those for the units that the joints have.

    Raises:
        QueryError: If it is not a positive number, or lacks the unit of a joint.
    """
    if not isinstance(given, Mapping):
        return number("accuracy", given, above=0)
    if unknown := [name for name in given if name not in _UNITS]:
        raise QueryError(f"accuracy: no unit {shown(unknown[0])}; give 'rad', 'm' or both")
    kinds = getattr(getattr(dynamics, "robot", dynamics), "joint_types", None)
    slides = [None] if kinds is None else [kind == "prismatic" for kind in kinds]
    units = [unit for unit, slide in zip(_UNITS, (False, True), strict=True) if slide in slides or None in slides]
    if missing := [unit for unit in units if unit not in given]:
        raise QueryError(f"accuracy: none is given for joints in {missing[0]}, got {shown(dict(given))}; add it")
    return min(number(f"accuracy in {unit}", given[unit], above=0) for unit in units)


def _check_returned(what: str, values: Any, n: int, of: str = "joint", *, error: Kind) -> None:
    """Raise the error unless a function returned n finite numbers, shape (n,); `what` is its name."""
    try:
        array = float64(values)
        found = f"shape {array.shape}" if array.shape != (n,) else ""
        if not (found or np.isfinite(array).all()):
            found = str(array[~np.isfinite(array)][0])
    except ValueError as problem:
        found = str(problem)
    if found:
        count = f"{n} {of}{'s' if n > 1 else ''}"
        raise error(f"{what} returned {found} for {count} at the start; it must be finite numbers of shape ({n},)")
