"""The same chains, states and laws for other programs, each with its own reader of the file; those that are installed.

MuJoCo: `fusestatic`, no balancing or bounding of inertias, the constraint solver off. Drake: the continuous plant.
PyBullet: inertias of the file, zeros written out where a link has none; it gives no accelerations. All are asked for M
and inverse dynamics, held to 32 n u of the terms, and forward dynamics, to 8 n u κ, as under Conditioning. An answer
that is not finite where one exists, or without a word where none exists, fails.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.accuracy import PeerError
from robot_dyn.queries import FORWARD_DYNAMICS, INVERSE_DYNAMICS, M
from tests.campaigns.hard.case import OURS, Case, Row
from tests.campaigns.hard.chains import CHAINS, LONG
from tests.campaigns.hard.conditioning import SOLVED, SUMS, errors, states
from tests.campaigns.hard.other_engines import installed

TITLE = "The peers: queries"
SAYS = "says:"
WORDS = (
    "import sys; from tests.campaigns.hard import peers;"
    " print(peers.SAYS + peers.words(int(sys.argv[1]), sys.argv[2], int(sys.argv[3])))"
)
Program = tuple[str, Callable[[rd.Robot], Any]]
CHAINS_ASKED = (
    "planar, 16 joints", "planar, 32 joints", "spatial, 16 joints", "mass ratio 1e-08", "mass ratio 1e+08",
    "tip of 1e-10 kg", "axes 1e-05 rad apart, 0.01 kg between", "links of 1e-06 m", "links of 1000 m",
    "from 1 km to 1 µm", "turning and sliding", "base 5000000 m away", "at the end of a beam of 10000 m",
)  # fmt: skip


def programs() -> Iterator[Program]:
    """Ours and those of others."""
    yield f"{OURS}, Lagrangian", rd.Lagrangian
    yield f"{OURS}, Pinocchio", lambda robot: robot
    yield from installed()


def chain(name: str, seed: int) -> Iterator[Row]:
    robot = rd.Robot.from_text((CHAINS | LONG)[name])
    at = states(robot.n, seed)
    for program, make in programs():
        try:
            found = list(errors(robot, {program: make(robot)}, at, (M, INVERSE_DYNAMICS)))
        except PeerError as refusal:
            yield Row(name, "refused", float("nan"), 0.0, str(refusal), program)
            continue
        sums = [each.error for each in found if each.quantity != FORWARD_DYNAMICS.name]
        yield Row(name, "M, ID, in n u", float(np.max(sums)), SUMS, "", program)
        if solved := [each for each in found if each.quantity == FORWARD_DYNAMICS.name]:
            worst = max(solved, key=lambda each: np.nan_to_num(each.error, nan=np.inf))
            yield Row(name, "FD, in n u κ", worst.error, SOLVED, worst.said, program)


def far(seed: int) -> Iterator[Row]:
    """UR5 at 1e16 rad."""
    robot, rng = rd.load("ur5"), np.random.default_rng((41, seed))
    v, a, tau = rng.normal(size=(3, robot.n))
    at = [{"q": 1e16 * rng.uniform(0.5, 1, robot.n), "v": v, "a": a, "tau": tau}]
    for program, make in programs():
        found = errors(robot, {program: make(robot)}, at, (M, INVERSE_DYNAMICS))
        sums = max(each.error for each in found if each.quantity != FORWARD_DYNAMICS.name)
        yield Row("ur5: q of 1e16 rad", "M, ID, in n u", sums, SUMS, "", program)


def without_answer(what: str, seed: int) -> Iterator[Row]:
    """A state without an answer: whether that is said."""
    for index, (program, _) in enumerate(programs()):
        command = [sys.executable, "-W", "ignore", "-c", WORDS, str(index), what, str(seed)]
        child = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
        said = child.stdout.strip().splitlines()[-1:] if not child.returncode else ["it ends the process"]
        said = "".join(said).removeprefix(SAYS)
        yield Row(f"ur5: {what}", "ID: answers without a word", float(not said), 0.0, said, program)


def words(index: int, what: str, seed: int) -> str:
    """What a program says; in a process of its own, since one of them ends it."""
    q, v, a = np.random.default_rng((43, seed)).normal(size=(3, 6))
    if what == "NaN":
        q[3] = np.nan
    else:
        v = 1e160 * v
    try:
        list(programs())[index][1](rd.load("ur5")).inverse_dynamics(q, v, a)
    except (RobotDynError, RuntimeError, ValueError) as refusal:
        return " ".join(str(refusal).split())[:120]
    return ""


CASES = [
    *(Case(name, partial(chain, name), name in LONG) for name in CHAINS_ASKED),
    Case("far angles", far),
    *(Case(what, partial(without_answer, what)) for what in ("NaN", "v of 1e160 rad/s")),
]
