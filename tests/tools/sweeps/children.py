"""Processes of tests that may hang, run out of memory or be killed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

_ROOT = Path(__file__).parents[2]
_START = """
import resource, sys
sys.path.insert(0, {root!r})
from pathlib import Path
from robot_dyn.tools import sweeps as sw
from robot_dyn.foundations.errors import RobotDynError
from tests.tools.sweeps.swept import swept
folder = Path({folder!r})
{first}
resource.setrlimit(resource.RLIMIT_AS, ({bytes}, {bytes}))
print("ready", flush=True)
try:
{code}
    print("done")
except RobotDynError:
    print("refused")
except Exception as error:
    print(type(error).__name__)
"""


def outcome_of(code: str, folder: Path, gib: int = 8, wait_s: float = 60.0, first: str = "") -> str:
    """Run code with `folder` and `sw` in a process of bounded memory.

    Args:
        code: Lines of Python.
        folder: What they call `folder`.
        gib: Bound of its address space, in [GiB].
        wait_s: Time that the code may take.
        first: Lines that are run before, without these bounds.

    Returns:
        "done", "refused" where it raised a RobotDynError, the name of another exception, "killed", or "hung" if it
        took longer than it may.
    """
    lines = "".join(f"    {line}\n" for line in code.splitlines())
    text = _START.format(root=str(_ROOT), bytes=gib << 30, folder=str(folder), code=lines, first=first)
    command = [sys.executable, "-c", text]  # without buffers, the first line takes no other with it
    with subprocess.Popen(command, bufsize=0, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        assert child.stdout is not None
        ready = child.stdout.readline()
        try:
            out, errors = child.communicate(timeout=wait_s)
        except subprocess.TimeoutExpired:
            child.kill()
            return "hung"
    assert ready == b"ready\n", errors.decode()
    return out.decode().split()[-1] if out else "killed"
