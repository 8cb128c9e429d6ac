"""How the file of a scene's robot is read: the options of `rd.load` that say what is estimated and what left out."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from robot_dyn.model.loading import load
from robot_dyn.model.robot import Robot
from robot_dyn.scene.schema import Part, Positive


class Loading(Part):
    """How the file of the robot is read. The summary of a run says what was estimated and what was left out."""

    inertia: Literal["stated", "from_shapes"] = "stated"
    """Inertias as in the file; or those that it lacks from the shapes of links, which opens mesh files."""
    mass_kg: dict[str, Positive] | None = None
    """With "from_shapes": masses by link."""
    total_mass_kg: Positive | None = None
    """With "from_shapes": mass of the whole robot, of which links without a mass share what is left by volume."""
    density_kg_per_m3: Positive | None = None
    """With "from_shapes", in place of `total_mass_kg`: of links whose mass is not known."""
    allow_overlap: bool = False
    """With "from_shapes": count what closed parts of a mesh share as often as they fill it; otherwise refuse it."""
    without: tuple[Literal["tendon", "equality", "free", "ball"], ...] = ()
    """What is left out of a file of MJCF."""

    def robot(self, name_or_path: str | Path) -> Robot:
        """The robot of a name or path."""
        return load(
            name_or_path, inertia=self.inertia, mass=self.mass_kg, total_mass=self.total_mass_kg,
            density=self.density_kg_per_m3, allow_overlap=self.allow_overlap, without=self.without,
        )  # fmt: skip
