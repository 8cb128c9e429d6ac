"""The tick of a controller in symbols, with the motions of its references as inputs.

(t, q, v, q_d, v_d, a_d, z, p) ↦ (u, z⁺)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import casadi as ca

from robot_dyn.codegen.parameters import Parameter, parameters_of_controller, split
from robot_dyn.codegen.trace.symbol import symbol
from robot_dyn.codegen.trace.symbolic import Symbolic, Symbols, column, inputs
from robot_dyn.codegen.trace.symbolic_dynamics import SymbolicDynamics
from robot_dyn.codegen.trace.symbolic_plant import symbolic_controller
from robot_dyn.control.controller import Controller
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import TraceError
from robot_dyn.model.right_angles import RightAngle, with_exact_right_angles
from robot_dyn.model.robot import Robot


@final
@dataclass(frozen=True)
class TickTrace:
    """A tick of a controller, without the bounds of a plant.

    Attributes:
        controller: The controller.
    """

    controller: Controller

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the function: gains, and numbers of references and models."""
        return parameters_of_controller(self.controller)

    @cached_property
    def _completed(self) -> dict[str, tuple[Robot, tuple[RightAngle, ...]]]:
        result = {}
        for name, model in self.controller.models.items():
            robot: object = getattr(model, "robot", model)
            if not isinstance(robot, Robot):
                raise TraceError(f"{name} of {self.controller.name} is a {type(model).__name__}: use a Robot")
            result[name] = with_exact_right_angles(robot)
        return result

    @property
    def models(self) -> dict[str, Robot]:
        """Models of the arm, by attribute of the controller, with right angles at full precision.

        Raises:
            TraceError: If a model is not a robot of a file.
        """
        return {name: robot for name, (robot, _) in self._completed.items()}

    @property
    def right_angles(self) -> tuple[RightAngle, ...]:
        """Angles of the models that their files state with too few digits."""
        return tuple(angle for _, angles in self._completed.values() for angle in angles)

    @cached_property
    def motions(self) -> dict[str, tuple[tuple[str, str, str], int]]:
        """Names of the inputs of each motion, and its number of coordinates, by attribute of the controller."""
        polynomials = {
            f"{name}.{attribute}".rstrip("."): polynomial
            for name, reference in self.controller.references.items()
            for attribute, polynomial in reference.polynomials.items()
        }
        one = [*polynomials] == [*self.controller.references]
        return {
            path: (("q_d", "v_d", "a_d") if one and len(polynomials) == 1 else _rates(path), polynomial.n)
            for path, polynomial in polynomials.items()
        }

    @cached_property
    def function(self) -> ca.Function:
        """The tick as a Function of t, q, v, the motions, z and p; its results are u and z_next.

        Raises:
            TraceError: If the controller cannot be traced.
        """
        n, size = self.controller.n, self.controller.state_size
        sizes = {"t": 1, "q": n, "v": n} | {name: k for names, k in self.motions.values() for name in names}
        sizes |= {"z": size, "p": sum(x.size for x in self.parameters)}
        symbols = {name: inputs(name, k) for name, k in sizes.items()}
        arrays = {name: array.view(Symbols) for name, (_, array) in symbols.items()}
        with Symbolic().scope():
            values, t = split(self.parameters, arrays["p"]), arrays["t"][0]
            pieces = [_Given(t, (arrays[q], arrays[v], arrays[a])) for (q, v, a), _ in self.motions.values()]
            models = {}
            for name, robot in self.models.items():
                own = ("model", name)
                of_robot = tuple(x for x in self.parameters if x.part == own)
                models[name] = SymbolicDynamics(robot, of_robot).with_parameters(values.get(own, {}))
            symbolic = symbolic_controller(self.controller, models, values, pieces)
            state = t, arrays["q"], arrays["v"], arrays["z"]
            results = {"u": column(symbolic.torque(*state))}
            if size:
                results["z_next"] = column(symbolic.next_state(*state))
        dense = ca.cse([ca.densify(x) for x in results.values()])
        return ca.Function("tick", [x for x, _ in symbols.values()], dense, [*symbols], [*results])


def _rates(path: str) -> tuple[str, str, str]:
    name = path.replace(".", "_")
    return name, f"{name}_rate", f"{name}_rate2"


@final
@dataclass(frozen=True)
class _Given:
    """A motion whose position, velocity and acceleration at the tick are inputs."""

    t: Any
    values: tuple[Array, Array, Array]

    def at(self, t: Any) -> tuple[Array, Array, Array]:
        """Return the inputs; TraceError at another time than that of the tick."""
        if not ca.is_equal(symbol(t).expression, symbol(self.t).expression):
            raise TraceError("its reference is used at a time other than that of the tick")
        return self.values
