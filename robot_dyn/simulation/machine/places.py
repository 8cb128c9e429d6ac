"""What Python and the machine code of a march agree on: where numbers stand in its arrays, and why it came back.

Entry e of lane b is number e W + b of the array of work.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import final

WATCHED = 64  # steps between looks at the energy
RUNAWAY = 1e3  # times all the energy there was, that may come from nowhere
DOUBTFUL = 1e6  # of Σ |y|: the interpreted engine looks at such a step, since M may be singular
LARGEST = 1e100  # of Σ |y| in a tile: beyond it products overflow


class Ended(IntEnum):
    """Why a march came back."""

    DONE = 0
    PAUSED = 1  # its budget of steps is spent
    DOUBTFUL = 2  # the next step is to be looked at; y is the state before it
    TICK = 3  # the controller asks for no finite torque
    GAINS = 4  # energy may grow without a source; y is the state after the step


class Now(IntEnum):
    """Where a march is: the entries of `now`."""

    STRETCH = 0
    STEP = 1  # of the stretch
    ROW = 2  # of the record, next
    STEPS = 3  # done in all
    SEEN = 4  # shared states, in all
    SHARED = 5  # row of the shared states, next
    BUDGET = 6  # steps to do before it comes back
    SAMPLING = 7  # 1: the rate and energies of given states, no steps
    EVERY = 8  # steps between shared states
    THIN = 9  # shared states between kept ones
    BASE = 10  # first lane of the record
    FINAL = 11  # 1: the last stretch is the end itself
    EVALUATIONS = 12  # of the rate, in all
    COLUMN = 13  # of what an observer sees, next


class Lane(IntEnum):
    """Rows of `lanes`: what is known of each lane."""

    ENDED = 0  # time at which it diverged
    REASON = 1  # 0: it goes on; 1: a number overflowed; 2: energy grows; 3: the stages of a step are not found
    ENERGY = 2  # at the start
    SCALE = 3  # of energies
    FASTEST = 4  # largest |q|
    JOINT = 5  # that moved fastest when it diverged


ARGUMENTS = (
    "work", "lanes", "alive", "starts", "lengths", "lasts", "counts", "ticks", "pieces", "at_ticks", "given",
    "which", "out_step", "out_y", "out_u", "out_e", "out_shared", "columns", "now", "clock", "stop",
)  # fmt: skip


@final
@dataclass(frozen=True)
class Places:
    """Where the rows of a march stand in its one array of work.

    Attributes:
        lanes: W.
        state: m, rows of y.
        held: Rows of what a sampled controller holds.
        free: Rows of values that differ from run to run.
        made: Rows that a rate makes: y' and the actuation.
        kept: Stages, and further rows of length m, that a method keeps.
    """

    lanes: int
    state: int
    held: int
    free: int
    made: int
    kept: int

    @property
    def size(self) -> int:
        """Length of the array."""
        return self.spare(self.kept)

    @property
    def y(self) -> int:
        """First number of y."""
        return 0

    @property
    def x(self) -> int:
        """First number of what a rate reads: a state, what is held, what is free."""
        return self.state * self.lanes

    @property
    def k(self) -> int:
        """First number of what a rate makes."""
        return self.x + (self.state + self.held + self.free) * self.lanes

    def spare(self, i: int) -> int:
        """First number of the i-th kept stage."""
        return self.k + (self.made + i * self.state) * self.lanes
