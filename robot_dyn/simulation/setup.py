"""The setup of a run: plant, start, duration, controller, method. A value; `simulate` turns it into a Trajectory."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from math import ceil, inf
from typing import final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.control.controller import Controller
from robot_dyn.effects.plant import Plant
from robot_dyn.errors import OverflowedError, QueryError
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.integrate.explicit import RK4
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.model.dynamics import checked
from robot_dyn.simulation.size import check_segments

ENGINES = ("auto", "interpreted", "compiled")


@final
@dataclass(frozen=True)
class Stretch:
    """A part of the run without ticks or switches inside.

    Attributes:
        start: In [s].
        end: In [s].
        tick: Whether a sampled controller acts at its start.
    """

    start: float
    end: float
    tick: bool


@final
@dataclass(frozen=True)
class Setup:
    """All that a run depends on.

    Attributes:
        plant: What moves.
        q0: Position at the start, (n,).
        v0: Velocity at the start, (n,); 0 if not given.
        duration_s: In [s].
        controller: What drives it, or None.
        integrator: A method of fixed step, or an `Adaptive` one.
        step_s: Fixed step; made a little smaller where ticks, switches and the end ask for it. Not to be given
            for an Adaptive method.
        record_period_s: Time between samples; 0 for every step.
        estimate_error: Whether companion runs of longer steps are made, which cost 3/4 of the run.
        about: Texts kept with the run.
        engine: "interpreted"; "compiled", the run in machine code, right angles of the file written out in
            full; or "auto", which compiles where that pays.
    """

    plant: Plant
    q0: Array
    v0: Array = None
    duration_s: float = 1.0
    controller: Controller | None = None
    integrator: Integrator | Adaptive = RK4
    step_s: float = 1e-3
    record_period_s: float = 0.0
    estimate_error: bool = True
    about: dict[str, str] = field(default_factory=dict, repr=False)
    engine: str = "auto"

    def __post_init__(self) -> None:
        names = self.plant.dynamics.joint_names
        if self.v0 is None:
            object.__setattr__(self, "v0", np.zeros(len(names)))
        if not isinstance(self.integrator, Integrator | Adaptive):
            raise QueryError(f"integrator: give one, as rd.method('rk4') or rd.Adaptive(), got {self.integrator!r}")
        for name in ("q0", "v0"):
            value = checked(name, getattr(self, name), names)
            if value.ndim != 1:
                raise QueryError(f"{name} must be one state of shape ({len(names)},), got {value.shape}")
            object.__setattr__(self, name, value)
        for name in ("duration_s", "step_s", "record_period_s"):
            value, least = getattr(self, name), 0.0 if name == "record_period_s" else 1e-12
            real = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
            if not (real and least <= value < inf):
                raise QueryError(f"{name} must be a positive number of seconds, got {value!r}")
            object.__setattr__(self, name, float(value))
        if isinstance(self.integrator, Adaptive) and self.step_s != Setup.step_s:
            raise QueryError("step_s has no effect on an Adaptive method; leave it out, or give Adaptive(max_step=…)")
        if self.engine not in ENGINES:
            raise QueryError(f"engine={self.engine!r}; give one of {', '.join(ENGINES)}")
        if not isinstance(self.controller, Controller | None):
            raise QueryError(f"controller: give one, such as rd.PD(…), or None, got {self.controller!r}")
        if self.controller is not None and self.controller.n != len(names):
            raise QueryError(f"the controller drives {self.controller.n} joints, the plant has {len(names)}")
        self._check_model()
        check_segments(self)
        self.plant.torque(0.0, self.q0, self.v0)  # so that an effect that does not fit is told now
        self.plant.actuation(np.zeros(len(names)))
        with suppress(OverflowedError):  # a start so far out is the outcome of a run
            self.plant.forward_dynamics(0.0, self.q0, self.v0, np.zeros(len(names)))  # a singular M is told at once

    def _check_model(self) -> None:
        """That the controller means the joints and links of the plant; a file with other names all over may fit too."""
        plant, model = self.plant.dynamics, getattr(self.controller, "model", None)
        pairs = tuple(zip(getattr(model, "joint_names", ()), plant.joint_names, strict=False))
        if any(own in plant.joint_names for own, _ in pairs):
            for own, name in pairs:
                if own != name:
                    raise QueryError(
                        f"the controller's model has the joint {own!r} where the plant has {name!r}; lock the same"
                        " joints of both"
                    )
        if isinstance(frame := getattr(self.controller, "frame", None), str):
            plant.placement(self.q0, frame)  # so that an unknown link is told now

    @property
    def stretches(self) -> tuple[Stretch, ...]:
        """The run cut at the ticks of the controller, the breaks of its reference and the switches of effects."""
        period = self.controller.period_s if self.controller else 0.0
        ticks = {k * period for k in range(max(1, ceil(self.duration_s / period - 1e-9)))} if period > 0 else {0.0}
        switches = {t for effect in self.plant.effects for t in effect.switches}
        switches |= set(self.controller.knots if self.controller else ())
        least = 1e-9 * self.duration_s  # cuts nearer than this differ by rounding alone
        cuts: list[tuple[float, bool]] = []
        for cut in sorted(ticks | {t for t in switches if 0.0 < t < self.duration_s}):
            if (
                cuts and cut - cuts[-1][0] < least
            ):  # one cut: at the switch, whose window is exact, and a tick if one is
                at = cut if cut in switches else cuts[-1][0]
                cuts[-1] = at, cuts[-1][1] or cut in ticks
            elif self.duration_s - cut >= least:
                cuts.append((cut, cut in ticks))
        return tuple(Stretch(a, b, tick) for (a, tick), (b, _) in pairwise([*cuts, (self.duration_s, False)]))

    def steps(self, stretch: Stretch) -> int:
        """Number of steps on a stretch: a multiple of 4, for the companion runs, where it has that many.

        Where the stretch holds record periods, each is a number of steps, so that samples lie on them.
        """
        length, record = stretch.end - stretch.start, self.record_period_s
        periods = round(length / record) if record else 0
        if periods and abs(length / record - periods) < 1e-9:
            each = max(1, ceil(record / self.step_s - 1e-9))
            while periods * each >= 4 and periods * each % 4:
                each += 1
            return periods * each
        count = max(1, ceil(length / self.step_s - 1e-9))
        return 4 * ceil(count / 4) if count >= 4 else count
