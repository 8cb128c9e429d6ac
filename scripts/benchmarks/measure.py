"""What benchmarks and the scripts beside them share: measuring, tables, arms and scenes."""

from __future__ import annotations

import os
import subprocess
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path
from statistics import median
from time import perf_counter
from timeit import timeit
from typing import Any, final

import numpy as np

import robot_dyn as rd
from robot_dyn.report.timing import in_turns
from robot_dyn.scene.scene import parse_scene
from robot_dyn.scene.starters import starter

PICTURES = Path(__file__).parents[2] / "docs" / "pictures"
BATCH = 4096
READY = np.array([0.3, 0.6, -0.4, -1.2, 0.5, 1.1, 0.2])  # of Panda-7, in [rad]


def command_line(description: str | None, quick: str) -> ArgumentParser:
    """The arguments of a script, with --quick."""
    parser = ArgumentParser(description=description, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help=quick)
    return parser


@final
@dataclass(frozen=True)
class Effort:
    """How long to measure: repeats of each side, and seconds of a loop."""

    repeats: int = 11
    at_least: float = 0.1

    @property
    def quick(self) -> bool:
        """Whether the only question is that everything runs."""
        return self.repeats < 5

    def picture(self, name: str) -> Path | None:
        """Where a figure of the docs is written; None for a quick run."""
        return None if self.quick else PICTURES / f"{name}.png"


def alternate(calls: Mapping[str, Callable[[], object]], effort: Effort) -> dict[str, float]:
    """Median time of each call in µs; the calls take turns."""
    return {name: 1e6 * median(times) for name, times in in_turns(calls, effort.repeats, effort.at_least).items()}


def lowest(calls: Mapping[str, Callable[[], object]], effort: Effort, number: int = 100) -> dict[str, float]:
    """Lowest time of each call in µs over loops of so many, short enough that other processes leave some alone."""
    times = dict.fromkeys(calls, inf)
    for _ in range(40 * effort.repeats):
        for name, call in calls.items():
            times[name] = min(times[name], 1e6 * timeit(call, number=number) / number)
    return times


def arms() -> dict[str, rd.Robot]:
    """The arms of every table."""
    return {"UR5": rd.load("ur5"), "Panda-7": panda()}


def panda() -> rd.Robot:
    """Panda without its fingers."""
    return rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})


def starter_setup(name: str) -> rd.Setup:
    """The setup of a starter scene."""
    return parse_scene(starter(name), name).setup(Path(), {})


def seconds(call: Callable[[], object]) -> float:
    """Time of one call, in [s]."""
    began = perf_counter()
    call()
    return perf_counter() - began


def printed(code: str, *arguments: str, **variables: str) -> list[float]:
    """The numbers that a new process prints, with more environment variables."""
    place = os.environ | variables
    place.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run([sys.executable, "-c", code, *arguments], env=place, check=True, capture_output=True)
    return [float(x) for x in done.stdout.split()]


def stick_and_stop(mujoco: Any, model: Any, friction: np.ndarray, lower: Any, upper: Any, stiff_h: float = 0.0) -> None:
    """Give a model of MuJoCo dry friction, stops if there are any, and Euler's method, whose damping is implicit.

    With stiff_h, the step in [s], at its stiffest settings: solref (2 h, 1) and solimp 0.9999; else at default ones.
    """
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    model.dof_frictionloss[:], model.jnt_limited[:] = friction, lower is not None
    if lower is not None:
        model.jnt_range[:] = np.column_stack([lower, upper])
    if stiff_h:
        for stiffness, width in ((model.dof_solref, model.dof_solimp), (model.jnt_solref, model.jnt_solimp)):
            stiffness[:], width[:, :2] = (2 * stiff_h, 1.0), 0.9999


def table(*headings: str) -> None:
    """The head of a table; words to the left, numbers to the right."""
    words = ("arm", "query", "bare calls", "C by", "what", "process")
    print("\n| " + " | ".join(headings) + " |")
    print("|" + "|".join("---" if heading in words else "--:" for heading in headings) + "|")


def row(*cells: object) -> None:
    """A row of a table."""
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)
