"""The parameters of a setup that `rollouts` can vary, with values and units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.codegen.parameters import Parameter, variable_parameters, with_parameters
from robot_dyn.control.controller import Controller
from robot_dyn.control.digital_loop.block import SIGNAL
from robot_dyn.control.digital_loop.loop import SIGNALS
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import coefficient_unit, joint_types_of
from robot_dyn.simulation.setup.setup import Setup


@final
@dataclass(frozen=True, eq=False)
class SetupParameter(ReadOnly):
    """A parameter that may differ from run to run.

    Attributes:
        name: Key in `vary` of `rollouts`.
        value: Value in the setup.
        unit: Unit for a revolute joint, and for a prismatic joint if that differs; empty if it has none.
        shape: Shape of its values over B runs, for example "(B,) or (B, 6)".
    """

    name: str
    value: np.ndarray
    unit: str
    shape: str


@final
@dataclass(frozen=True, eq=False, repr=False)
class Parameters(Answer):
    """The parameters of a setup that `rollouts` can vary.

    Attributes:
        parameters: Parameters in the order of robot, effects, controller and its models.
    """

    parameters: tuple[SetupParameter, ...]

    def blocks(self) -> Iterator[Block]:
        yield "initial states: q0= and v0= of rd.rollouts, each (B, n); --vary 'q0=…' and 'v0=…' of a sweep"
        yield "parameters that rd.rollouts(setup, vary={name: values}) and --vary of a sweep can vary over B runs:"
        rows = ((x.name, _shown(x.value), x.unit, x.shape) for x in self.parameters)
        yield Table(("name", "value", "unit", "values"), tuple(rows))


def parameters(system: Setup | Plant | Dynamics) -> Parameters:
    """Return the parameters that `rollouts` can vary: names, values, units and shapes.

    They are coefficients of effects, gains of the controller, gravity, payloads, armature, the factor on all masses,
    mass, inertia and mass scale of each link, and the same for the controller's models. Its `repr` is the table that
    `robot-dyn parameters` prints, `to_json()` the document of its `--json`.

    Args:
        system: A setup, a plant or a robot.

    Raises:
        EffectError: If it is none of these.
    """
    setup = system if isinstance(system, Setup) else None
    plant = setup.plant if setup is not None else system if isinstance(system, Plant) else Plant(system)  # pyright: ignore[reportArgumentType]
    controller = None if setup is None else setup.controller
    parameters = variable_parameters(plant.dynamics, plant.effects, controller)
    by_name = {parameter.name: setup_parameter(parameter, plant.dynamics) for parameter in reversed(parameters)}
    return Parameters(tuple(by_name.values())[::-1])


def setup_parameter(parameter: Parameter, dynamics: Dynamics) -> SetupParameter:
    """Return a parameter of `robot_dyn.codegen.parameters` with its unit."""
    types = joint_types_of(dynamics)
    of_joints, value = parameter.declared.is_per_joint, parameter.value
    signal = SIGNALS.get(parameter.name.partition(".")[0], SIGNAL)
    unit = coefficient_unit(replace(parameter.declared, unit=parameter.declared.unit.replace(SIGNAL, signal)), types)
    shape = f"(B,) or (B, {value.size})" if of_joints else f"(B{''.join(f', {n}' for n in value.shape)})"
    return SetupParameter(parameter.name, value, unit, shape.replace("(B)", "(B,)"))


def _shown(value: np.ndarray) -> str:
    """Return one number, all numbers if they differ, or the diagonal of a matrix."""
    if value.ndim == 2:
        return f"diagonal {', '.join(f'{x:g}' for x in value.diagonal())}"
    if value.ndim == 1 and value.size > 1 and (value == value[0]).all():
        return f"{value[0]:g} each"
    return ", ".join(f"{x:g}" for x in value.flat)


def parts_of_run(setup: Setup, values: Mapping[str, ArrayLike], number: int) -> tuple[Plant, Controller | None]:
    """Return plant and controller of the run with this number, with its values by name and its noise."""
    plant, controller = setup.plant, setup.controller
    if values:
        plant, controller = with_parameters(plant, controller, values)
    return plant, None if controller is None else controller.of_run(number)
