"""The table `[sweep]` of a scene: varying parameters and figures of many runs."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_dyn.scene import Part


class SweepTable(Part):
    """Varying parameters and figures of many runs of the scene: `robot-dyn sweep scene.toml -o FOLDER`.

    Values of `vary` and `figures` are texts, which are parsed but not executed: distributions `uniform(low=0, high=3)`,
    `normal(mean=1, sd=0.1)`, `lognormal(median=1, sigma_of_log=0.2)`, `triangular(low=0, mode=1, high=3)`,
    `choice([50, 100])`. An array takes lists, for example `normal(mean=[0, 1.2], sd=0.1)` for the `q0` of two joints.
    The reference does not move with `q0`; it is built from the start of the scene. Figures are `rms_tracking_error()`,
    `peak('u')` and `final('q', 'joint')`.
    """

    runs: Annotated[int, Field(gt=0, strict=True)]
    """Number of runs."""
    vary: dict[str, str]
    """Distributions by the names of `robot-dyn parameters`, and of `q0` and `v0`."""
    figures: dict[str, str] = Field(default={})
    """Figures of each run, by name."""
    design: str = "random"
    """One of "random", "sobol", "halton", "latin", "saltelli", "grid"."""
    seed: Annotated[int, Field(ge=0, strict=True)] = 0
    """Seed of the design."""
    uncut: bool = False
    """Let steps pass thresholds, in lock step; the result compares the figures of 64 runs simulated both ways."""
    samples: str | None = None
    """Samples to keep: `q`, `v` or `u` of all runs, or `samples('q', 'v', every=10, failed=True)`."""
