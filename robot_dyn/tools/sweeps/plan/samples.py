"""Which samples of runs a sweep keeps: of every run, of every k-th, or of those that diverge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.foundations import SweepError, Value, choice, integer, truth

RECORDED = ("q", "v", "u")


@final
@dataclass(frozen=True)
class Samples(Value):
    """Samples of runs.

    Attributes:
        names: Of "q", "v" and "u".
        every: Of run 0, k, 2 k, ….
        failed: Of those among them alone that diverge, up to their end.
    """

    names: tuple[str, ...]
    every: int = 1
    failed: bool = False

    def of(self, runs: np.ndarray, diverged: np.ndarray) -> np.ndarray:
        """Which of these runs are kept, (k,)."""
        return (runs % self.every == 0) & (diverged | (not self.failed))


def samples(*names: str, every: int = 1, failed: bool = False) -> Samples:
    """Samples to keep of runs: of every k-th, or of those among them alone that diverge.

    Args:
        *names: Of "q", "v" and "u".
        every: k.
        failed: Whether only of runs that diverge.

    Raises:
        SweepError: If an argument is not allowed.
    """
    if not names:
        raise SweepError(f"samples: of what? give some of {', '.join(RECORDED)}")
    chosen = tuple(dict.fromkeys(choice("samples", name, RECORDED, error=SweepError) for name in names))
    return Samples(chosen, integer("every", every, least=1, most=2**53, error=SweepError), truth("failed", failed))


def samples_of(given: Any) -> Samples | None:
    """What `Sweep.samples` may be: None, a name, or `samples(…)`; SweepError otherwise."""
    return given if given is None or isinstance(given, Samples) else samples(given)
