"""A process that loads files, each in a fork of its own under limits of memory and time; forks save the imports.

It reads paths from its standard input, a line of JSON each, and answers with exit code, output and errors of the fork.
"""

from __future__ import annotations

import json
import math
import os
import resource
import signal
import sys
import traceback
import warnings
from collections.abc import Callable
from functools import partial
from tempfile import TemporaryFile
from typing import Any

import robot_dyn

GIB, CPU_S, SECONDS = 4, 18, 60  # the last of wall time, which on a shared machine is more


def forward_dynamics(robot: robot_dyn.Robot) -> str:
    still = [0.0] * robot.n
    try:
        a = robot.forward_dynamics([0.5] * robot.n, still, still)
    except robot_dyn.RobotDynError as error:
        return f"{type(error).__name__}: {error}"
    return "ok" if all(map(math.isfinite, a)) else f"not finite: {a}"


def report(path: str) -> dict[str, Any]:
    """What became of a file."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            robot = robot_dyn.load(path)
        except robot_dyn.RobotDynError as error:
            found: dict[str, Any] = {"outcome": "refused", "kind": type(error).__name__, "message": str(error)}
        else:
            found = {"outcome": "loaded", "forward_dynamics": forward_dynamics(robot), "upper": list(robot.upper)}
            few = 1 < robot.n < 10
            found["held"] = robot.with_(lock={robot.joint_names[0]: 0.5}).n if few else None
    return found | {"warnings": [f"{type(w.message).__name__}: {w.message}" for w in caught]}


def limited(path: str) -> None:
    """Print the report of a file; a time that is up ends the process."""
    resource.setrlimit(resource.RLIMIT_AS, (GIB << 30, GIB << 30))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.alarm(SECONDS)
    print(json.dumps(report(path)), flush=True)


def forked(work: Callable[[], None]) -> dict[str, Any]:
    """Exit code, output and errors of work in a process of its own."""
    with TemporaryFile() as out, TemporaryFile() as err:
        child = os.fork()
        if child == 0:
            os.dup2(out.fileno(), 1)
            os.dup2(err.fileno(), 2)
            try:
                work()
                os._exit(0)
            except BaseException:
                traceback.print_exc()
                sys.stderr.flush()
            finally:
                os._exit(1)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read().decode())
    return {"returncode": code, "stdout": texts[0], "stderr": texts[1]}


if __name__ == "__main__":
    report("planar_2r")  # what is imported on first use
    for line in sys.stdin:
        print(json.dumps(forked(partial(limited, json.loads(line)))), flush=True)
