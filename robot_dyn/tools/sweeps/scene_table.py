"""The table `[sweep]` of a scene: what varies in many runs of it, and what is kept of each."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_dyn.scene import Part


class SweepTable(Part):
    """What varies in many runs of the scene, and what is kept of each: `robot-dyn sweep scene.toml -o FOLDER`.

    Values of `vary` and `figures` are texts, which are parsed and not run: distributions `uniform(low=0, high=3)`,
    `normal(mean=1, sd=0.1)`, `lognormal(median=1, sigma_of_log=0.2)`, `triangular(low=0, mode=1, high=3)`,
    `choice([50, 100])`, of lists of numbers for arrays; figures `rms_error()`, `peak('u')`, `final('q', 'joint')`.
    """

    runs: Annotated[int, Field(gt=0, strict=True)]
    """How many."""
    vary: dict[str, str]
    """Distributions by the names of `robot-dyn sweepable`, and of `q0` and `v0`."""
    figures: dict[str, str] = Field(default={})
    """What is kept of each run, by name."""
    design: str = "random"
    """One of "random", "sobol", "halton", "latin", "saltelli", "grid"."""
    seed: Annotated[int, Field(ge=0, strict=True)] = 0
    """Of the design."""
    samples: str | None = None
    """Samples that are kept: `q`, `v` or `u` of all runs, or `samples('q', 'v', every=10, failed=True)`."""
