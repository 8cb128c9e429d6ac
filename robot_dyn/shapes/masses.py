"""Masses of links that a file does not state: given by link, by the total of the robot, or by a density.

total    mᵢ = (total − Σ stated) Vᵢ / Σ V     V: volume of the convex hulls of the shapes
density  mᵢ = ρ Vᵢ                           V: volume of the solids; convex hulls for open meshes
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

from robot_dyn.foundations.errors import QueryError, nearest, shown
from robot_dyn.foundations.validate import number, truth
from robot_dyn.shapes.link_shapes import LinkShape


@final
@dataclass(frozen=True, eq=False)
class Masses:
    """Masses to use where a file states none.

    Attributes:
        by_link: Mass by link, positive, in [kg].
        total: Mass of the whole robot with its base, in [kg], or None; mass not stated elsewhere is shared by volume.
        density: Density in [kg/m³] of links without a mass, or None.
        allow_overlap: Accept closed parts of a mesh that overlap, and count the shared volume once for each part.

    Raises:
        QueryError: If a value is not a positive number, both total and density are given, or no mass at all is given.
    """

    by_link: Mapping[str, float]
    total: float | None = None
    density: float | None = None
    allow_overlap: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.by_link, Mapping):
            raise QueryError(
                f"mass must map links to masses in kg, for example {{'link_1': 2.5}}, got {shown(self.by_link)}"
            )
        masses = {link: number(f"mass of link {link!r}", mass, above=0) for link, mass in self.by_link.items()}
        object.__setattr__(self, "by_link", masses)
        truth("allow_overlap", self.allow_overlap)
        for name, key in (("total_mass", "total"), ("density", "density")):
            if (value := getattr(self, key)) is not None:
                object.__setattr__(self, key, number(name, value, above=0))
        if self.total is not None and self.density is not None:
            raise QueryError("total_mass and density exclude each other; give one of them")
        if not masses and self.total is None and self.density is None:
            raise QueryError("inertias from shapes need a mass: give mass by link, total_mass or density")

    def check_links(self, links: Mapping[str, object], measured: Mapping[str, float]) -> None:
        """Raise QueryError for an unknown link, or one whose mass the file states; `measured` has these masses."""
        for link in self.by_link:
            if link not in links:
                raise QueryError(f"mass: no link {link!r}; {nearest(str(link), [*links])}")
            if link in measured:
                raise QueryError(
                    f"mass: link {link!r} has {measured[link]:g} kg in its file, which estimates cannot replace;"
                    " remove it, or change the mass with Robot.with_(masses=…)"
                )

    def shared(self, shapes: Mapping[str, LinkShape], measured: float) -> dict[str, tuple[float, str]]:
        """Return the mass of each link with a shape, and the origin of the mass, where these masses define it.

        Args:
            shapes: Shapes of the links whose mass the file does not state.
            measured: Mass of the other links together, in [kg].

        Raises:
            QueryError: If the total leaves no mass to share, or no link can take a share.
        """
        result = {link: (mass, "given") for link, mass in self.by_link.items()}
        others = {link: shape for link, shape in shapes.items() if link not in result}
        if self.density is not None:
            origin = f"at {self.density:g} kg/m³"
            result |= {link: (self.density * shape.solid.mass, origin) for link, shape in others.items()}
        if self.total is not None:
            left = self.total - measured - sum(self.by_link.values())
            if not others:
                raise QueryError(
                    "total_mass: every link without a mass also lacks a shape, so no mass can be distributed;"
                    " remove total_mass"
                )
            if left <= 0:
                stated = self.total - left
                raise QueryError(
                    f"total_mass of {self.total:g} kg does not exceed the {stated:g} kg that the file and mass"
                    f" state; correct it"
                )
            volume = sum(shape.hull.mass for shape in others.values())
            origin = f"by its share of hull volume in a total of {self.total:g} kg: {left / volume:.4g} kg/m³"
            result |= {link: (left * shape.hull.mass / volume, origin) for link, shape in others.items()}
        return result
