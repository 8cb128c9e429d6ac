"""Masses of links that a file leaves out: given by link, by the total of the robot, or by a density.

total    mᵢ = (total − Σ known) Vᵢ / Σ V     V: volume of the convex hulls of the shapes
density  mᵢ = ρ Vᵢ                           V: volume of the solids, of open meshes that of their convex hulls
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

from robot_dyn.foundations.errors import QueryError, nearest, shown
from robot_dyn.foundations.validate import number, truth
from robot_dyn.shapes.link_shapes import LinkShape


@final
@dataclass(frozen=True, eq=False)
class Masses:
    """What is known of the masses that a file leaves out.

    Attributes:
        of: Mass by link, positive, in [kg].
        total: Mass of the whole robot with its base, in [kg]: what the known masses leave is shared by volume; or None.
        density: In [kg/m³], of links whose mass is not known otherwise; or None.
        allow_overlap: Whether what closed parts of a mesh share counts as often as they fill it; otherwise such meshes
            are refused.

    Raises:
        QueryError: If a value is not a positive number, both total and density are given, or neither any mass.
    """

    of: Mapping[str, float]
    total: float | None = None
    density: float | None = None
    allow_overlap: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.of, Mapping):
            raise QueryError(f"mass must give masses by link, such as {{'link_1': 2.5}}, got {shown(self.of)}")
        of = {link: number(f"mass of link {link!r}", mass, above=0) for link, mass in self.of.items()}
        object.__setattr__(self, "of", of)
        truth("allow_overlap", self.allow_overlap)
        for name, key in (("total_mass", "total"), ("density", "density")):
            if (value := getattr(self, key)) is not None:
                object.__setattr__(self, key, number(name, value, above=0))
        if self.total is not None and self.density is not None:
            raise QueryError("total_mass and density contradict each other; give one of them")
        if not of and self.total is None and self.density is None:
            raise QueryError("inertias from shapes need a mass: give mass by link, total_mass or density")

    def check_links(self, links: Mapping[str, Any], measured: Mapping[str, float]) -> None:
        """Raise QueryError for a link that is unknown, or whose mass the file states already, (link: [kg])."""
        for link in self.of:
            if link not in links:
                raise QueryError(f"mass: no link {link!r}; {nearest(str(link), [*links])}")
            if link in measured:
                raise QueryError(
                    f"mass: link {link!r} has {measured[link]:g} kg in its file, which is not estimated; leave it out,"
                    " or replace it by Robot.with_(masses=…)"
                )

    def shared(self, shapes: Mapping[str, LinkShape], measured: float) -> dict[str, tuple[float, str]]:
        """Mass and its origin of each link with a shape, as far as it is known.

        Args:
            shapes: Of the links whose mass the file leaves out.
            measured: Mass of the other links together, in [kg].

        Raises:
            QueryError: If the total leaves no mass to be shared, or there is no link to share it.
        """
        found = {link: (mass, "given") for link, mass in self.of.items()}
        others = {link: shape for link, shape in shapes.items() if link not in found}
        if self.density is not None:
            origin = f"at {self.density:g} kg/m³"
            found |= {link: (self.density * shape.solid.mass, origin) for link, shape in others.items()}
        if self.total is not None:
            left = self.total - measured - sum(self.of.values())
            if not others:
                raise QueryError("total_mass: no link without a mass has a shape that could take a share; leave it out")
            if left <= 0:
                known = self.total - left
                raise QueryError(f"total_mass of {self.total:g} kg leaves nothing: {known:g} kg are known; correct it")
            volume = sum(shape.hull.mass for shape in others.values())
            origin = f"its share, by volume, of a total of {self.total:g} kg: {left / volume:.4g} kg/m³ of its hull"
            found |= {link: (left * shape.hull.mass / volume, origin) for link, shape in others.items()}
        return found
