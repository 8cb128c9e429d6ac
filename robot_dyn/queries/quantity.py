"""Rows of the table of queries: arguments, shape, unit and scale of a quantity of M(q) a + C(q, v) v + N(q) = τ.

`query` turns a method of `Dynamics` into a row; its signature and its docstring are part of the row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from inspect import cleandoc, signature
from math import inf
from typing import Any, TypeVar, final

from robot_dyn.foundations.arithmetic import Scalar
from robot_dyn.queries.units import of_joint

DOUBTFUL = 1e10  # ‖a‖ above which M may be singular at this q, hidden by rounding
MAX_DIGITS = 20  # maximum number of digits counted

State = Mapping[str, Scalar]
Key = str | tuple[str, ...]  # name of a query, or (name, link) or (name, link, axes) of a query of a frame
Method = TypeVar("Method", bound=Callable[..., Any])

_PARAMETERS = {
    "q": "Positions, shape (..., n), in [rad] or [m] by joint.",
    "v": "Velocities, shape (..., n), in [rad/s] or [m/s].",
    "a": "Accelerations, shape (..., n), in [rad/s²] or [m/s²].",
    "v_r": "Reference velocities, shape (..., n), in [rad/s] or [m/s]; v by default.",
    "tau": "Torques, shape (..., n), in [N m] or [N].",
    "frame": "Name of a link, or of a joint for the frame of its child link; if both have the name, the link is meant.",
    "expressed_in": """Axes and reference point of the twist: "world_aligned" (frame's origin, along the base's axes),
        "body" (along the frame's axes) or "world" (at the base's origin); or Pinocchio's names "local_world_aligned",
        "local", "world".""",
    "out": "Array that receives the result and is returned; it is unchanged if the query raises.",
}


def _no_terms(size: Any, x: State) -> float:
    """Return the terms of a quantity without contributions of rigid bodies."""
    return 0.0


@final
@dataclass(frozen=True)
class Quantity:
    """A quantity that an engine computes by the method of the same name.

    Attributes:
        name: Name of the method.
        description: First line of its docstring.
        arguments: Names of its arguments, each of shape (..., n); "t" is a time.
        axes: Shape for one state: numbers, or letters for sizes of a robot: "n" degrees of freedom, "p" inertial
            parameters. Every query accepts batches, see `queries.batch`.
        unit: Unit for revolute joints; `units.of_joint` converts it for prismatic ones.
        terms: Function that returns the sum of the absolute values of the terms of each entry, from
            `lagrange.magnitude.Magnitudes` at q, the absolute values of the arguments by name, and the frame if it
            has one. If M a = τ is solved, it returns the terms of τ.
        framed: True for a quantity of a frame.
        directed: True if the axes of its twist are an option.
        definite: True for a symmetric positive definite matrix, so that |x_ij| ≤ √(x_ii x_jj).
        solves: True if M a = τ is solved: there is no result if M is singular, and errors grow with M's condition.
        doubtful: Size of a result above which M may be singular.
        digits: True if `rd.accuracy.digits` and certificates count its digits.
    """

    name: str
    arguments: tuple[str, ...]
    axes: tuple[int | str, ...]
    unit: str = ""
    description: str = ""
    terms: Callable[..., Any] = _no_terms
    framed: bool = False
    directed: bool = False
    definite: bool = False
    solves: bool = False
    doubtful: float = inf
    digits: bool = False

    def shape(self, sizes: Mapping[str, int]) -> tuple[int, ...]:
        """Return the shape for one state of a robot with these sizes."""
        return tuple(axis if isinstance(axis, int) else sizes[axis] for axis in self.axes)

    def units(self, joint_types: Iterable[str]) -> tuple[str, ...]:
        """Return the distinct units of entries, for joints of these types."""
        if self.axes[:1] != ("n",):
            return (self.unit,)
        return tuple(dict.fromkeys(of_joint(self.unit, kind) for kind in joint_types))

    def evaluate(self, engine: Any, state: State, *frame: str, **options: Any) -> Any:
        """Return the result of an engine at a state, with arguments by name."""
        return getattr(engine, self.name)(*(state[name] for name in self.arguments), *frame, **options)


def of_frame(quantity: Quantity, link: str) -> Quantity:
    """Return a quantity of one link, with the scale of its entries there."""
    return replace(quantity, terms=lambda size, state: quantity.terms(size, state, link))


def title(key: Key) -> str:
    """Return the name of a query for messages, such as "jacobian of tool0, body"."""
    return key if isinstance(key, str) else f"{key[0]} of {', '.join(key[1:])}"


def query(*axes: int | str, unit: str, terms: Callable[..., Any], **properties: Any) -> Callable[[Method], Method]:
    """Return a decorator that makes a method a row of the table and completes its docstring.

    Args:
        *axes: Shape for one state, as in `Quantity`.
        unit: Unit for revolute joints.
        terms: Scale of entries, as in `Quantity`.
        **properties: Other fields of `Quantity`: definite, solves, doubtful, digits.
    """

    def row(method: Method) -> Method:
        parameters = list(signature(method).parameters)[1:]
        text = cleandoc(method.__doc__ or "")
        arguments = tuple(name for name in parameters if name in ("q", "v", "a", "tau"))
        quantity = Quantity(
            method.__name__, arguments, axes, unit, text.partition("\n")[0], terms,
            framed="frame" in parameters, directed="expressed_in" in parameters, **properties,
        )  # fmt: skip
        vars(method)["quantity"] = quantity
        method.__doc__ = f"{text}\n\n{_sections(quantity, parameters)}"
        return method

    return row


def table(engine: type) -> dict[str, Quantity]:
    """Return the rows that a class defines, by the names of its methods."""
    return {name: vars(method)["quantity"] for name, method in vars(engine).items() if hasattr(method, "quantity")}


def _sections(quantity: Quantity, parameters: list[str]) -> str:
    """Return the sections Args, Returns and Raises of a docstring."""
    letters = {"p": "10 N"}
    shape = ", ".join(["...", *(letters.get(str(axis), str(axis)) for axis in quantity.axes)])
    units = " or ".join(f"[{unit}]" for unit in quantity.units(("revolute", "prismatic")))
    lines = ["Args:", *(f"    {name}: {_PARAMETERS[name]}" for name in parameters), ""]
    lines += ["Returns:", f"    Array of shape ({shape}), in {units}.", ""]
    unknown = ", or the frame or its axes are unknown" if quantity.framed else ""
    lines += ["Raises:", f"    QueryError: If an argument has the wrong shape or is not finite{unknown}."]
    lines += ["    OverflowedError: If the result would not be finite."]
    return "\n".join(lines + ["    SingularError: If M is singular."] * quantity.solves)
