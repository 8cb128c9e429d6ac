"""Solids of uniform or arbitrary density: m = ∫ ρ dx, c = (1/m) ∫ ρ x dx, I = ∫ ρ r̂ᵀ r̂ dx with r = x − c.

Solids of uniform density have their centre of mass at the origin and their principal axes along x, y, z;
`MassProperties.moved` places them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.description.inertia import MassProperties
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.spatial import hat
from robot_dyn.foundations.validate import integer, number, numbers, rows

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


Density = Callable[[np.ndarray], "ArrayLike"]
Chart = Callable[[np.ndarray], tuple["ArrayLike", "ArrayLike"]]


def box(mass: float, lx: float, ly: float, lz: float) -> MassProperties:
    """Return a box with edges along x, y, z: I = m/12 · (ly² + lz², lx² + lz², lx² + ly²), volume lx ly lz.

    Args:
        mass: Mass in [kg].
        lx: Edge along x, in [m].
        ly: Edge along y, in [m].
        lz: Edge along z, in [m].

    Raises:
        QueryError: If a length or the mass is not positive.
    """
    x, y, z = _squares(lx=lx, ly=ly, lz=lz)
    return _principal(mass, np.array([y + z, x + z, x + y]) / 12)


def cylinder(mass: float, radius: float, height: float) -> MassProperties:
    """Return a cylinder with its axis along z: I = m/12 · (3 r² + h², 3 r² + h², 6 r²), volume π r² h.

    Args:
        mass: Mass in [kg].
        radius: Radius r, in [m].
        height: Height h, in [m].

    Raises:
        QueryError: If a length or the mass is not positive.
    """
    r, h = _squares(radius=radius, height=height)
    return _principal(mass, np.array([3 * r + h, 3 * r + h, 6 * r]) / 12)


def ellipsoid(mass: float, a: float, b: float, c: float) -> MassProperties:
    """Return an ellipsoid with semi-axes a, b, c along x, y, z: I = m/5 · (b² + c², a² + c², a² + b²), volume 4π abc/3.

    Args:
        mass: Mass in [kg].
        a: Semi-axis along x, in [m].
        b: Semi-axis along y, in [m].
        c: Semi-axis along z, in [m].

    Raises:
        QueryError: If a length or the mass is not positive.
    """
    x, y, z = _squares(a=a, b=b, c=c)
    return _principal(mass, np.array([y + z, x + z, x + y]) / 5)


def sphere(mass: float, radius: float) -> MassProperties:
    """Return a sphere: I = ⅖ m r², volume 4π r³/3; mass in [kg], radius in [m].

    Raises:
        QueryError: If the radius or the mass is not positive.
    """
    return ellipsoid(mass, radius, radius, radius)


@np.errstate(over="ignore", invalid="ignore")  # the checks below reject values that overflow
def from_density(
    density: Density, lower: ArrayLike, upper: ArrayLike, *, chart: Chart | None = None, points: int = 24
) -> MassProperties:
    """Compute mass, centre of mass and inertia of a density field by Gauss–Legendre quadrature over a box.

        m = ∫ ρ dx,   c = (1/m) ∫ ρ x dx,   I = ∫ ρ r̂ᵀ r̂ dx

    The result is exact for a polynomial ρ of degree 2·points − 3 in each coordinate, and converges fast for a smooth
    ρ. It converges slowly across a jump of ρ: integrate each part over a separate box and combine the results, or
    choose a chart in which the surface of the body is a side of the box.

    Args:
        density: ρ(x) in [kg/m³], of shape (...) for points x of shape (..., 3) in [m].
        lower: Lower corner of the box, shape (3,), in [m], or in the coordinates of the chart.
        upper: Upper corner, shape (3,).
        chart: u (..., 3) ↦ (x (..., 3), |det ∂x/∂u| (...)), for example cylindrical coordinates; None for x = u.
        points: Nodes along each axis, 1 to 100.

    Raises:
        QueryError: If a shape is wrong, the box is empty, ρ is negative or not finite somewhere, or the mass is 0.

    Source: Murray, Li, Sastry 1994, ch. 4 §2.2; Golub and Welsch, Calculation of Gauss quadrature rules, 1969.
    """
    u, weight = _nodes(lower, upper, points)
    x = u
    if chart is not None:
        try:
            x, jacobian = chart(u)
        except (TypeError, ValueError) as error:
            raise QueryError(f"chart must map u (N, 3) to x (N, 3) and |det ∂x/∂u| (N,): {error}") from error
        x = rows("x of the chart", x, 3)
        weight = weight * _field("|det ∂x/∂u|", jacobian, weight.shape)
    dm = weight * _field("density", density(x), weight.shape)
    mass = dm.sum()
    if not mass > 0:
        raise QueryError(
            "density is 0 in the whole box, so there is no centre of mass; give a density that is positive somewhere"
        )
    com = dm @ x / mass
    r = hat(x - com)
    return MassProperties(mass, com, np.tensordot(dm, np.swapaxes(r, -1, -2) @ r, 1))


def _nodes(lower: ArrayLike, upper: ArrayLike, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (N, 3) and weights (N,) of the product rule over a box."""
    lower, upper = numbers("lower", lower, (3,)), numbers("upper", upper, (3,))
    if not np.all(upper > lower):
        raise QueryError(f"a box needs corners lower < upper, got {lower} and {upper}")
    node, weight = np.polynomial.legendre.leggauss(integer("points", points, least=1, most=100))
    half = (upper - lower) / 2
    axes = [c + h * node for c, h in zip((upper + lower) / 2, half, strict=True)]
    u = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return u, np.einsum("i,j,k->ijk", *(h * weight for h in half)).reshape(-1)


def _field(name: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return the values of a field at the nodes, or its single value if it is constant."""
    return numbers(f"{name} of points (N, 3)", values, (), shape, least=0)


def _squares(**lengths: Any) -> np.ndarray:
    checked = [number(name, length, above=0) for name, length in lengths.items()]
    with np.errstate(over="ignore"):  # MassProperties rejects an infinite inertia
        return np.array(checked) ** 2


def _principal(mass: Any, per_mass: np.ndarray) -> MassProperties:
    m = number("mass", mass, above=0)
    inertia = np.zeros((3, 3))
    with np.errstate(over="ignore"):
        np.fill_diagonal(inertia, m * per_mass)
    return MassProperties(m, np.zeros(3), inertia)
