"""The command as the tests run it: in a process of its own, or, to save the start, in this one."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

ROOT = Path(__file__).parents[1]
MAIN = "from robot_dyn.cli import main; main()"
Done = subprocess.CompletedProcess


def spawn(*args: str | Path, code: str = MAIN, **environment: str) -> Done[bytes]:
    """The command in a process of its own, its output in pipes."""
    command = [sys.executable, "-c", code, *map(str, args)]
    return subprocess.run(command, capture_output=True, timeout=60, env=os.environ | environment)


@contextmanager
def started(*args: str | Path, code: str = MAIN) -> Iterator[subprocess.Popen[str]]:
    """The command at work in a process of its own, which ends with the block, whatever happens there."""
    command = [sys.executable, "-c", code, *map(str, args)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8") as process:
        try:
            yield process
        finally:
            process.kill()


AT_WORK = """import sys
from robot_dyn.cli import main
def tell():
    print("at work", file=sys.stderr, flush=True)
{}
main()
"""


def interrupted_at_work(*args: str | Path, watched: str) -> str:
    """Output of a command that Ctrl-C ends once `tell()` was called, from code that is put around its work."""
    with started(*args, code=AT_WORK.format(watched)) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "at work\n"
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    return out


def run(*args: str | Path) -> Done[str]:
    """The command in this process, its output no terminal; test_command_line.py checks that it is the same."""
    from robot_dyn.cli import main

    argv = ["-c", *map(str, args)]
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", write_through=True) for _ in range(2))
    handler = signal.getsignal(signal.SIGINT)  # the command leaves it ignored, as the last act of a process
    slow = mock.patch("robot_dyn.foundations.waiting.PATIENCE_S", 600.0)  # a busy machine waits longer
    with slow, mock.patch.multiple(sys, argv=argv, stdout=out, stderr=err):
        try:
            main()
            code = 0
        except SystemExit as end:
            code = end.code or 0
        finally:
            signal.signal(signal.SIGINT, handler)
    return Done(argv, code, *(stream.buffer.getvalue().decode() for stream in (out, err)))  # type: ignore[attr-defined]


def said(*args: str | Path) -> str:
    """Standard output of a command that succeeds in silence."""
    done = run(*args)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def document(*args: str | Path) -> Any:
    """What --json prints."""
    return json.loads(said(*args, "--json"))


def refusal(args: Iterable[str | Path]) -> str:
    """The one line of a command that is refused."""
    done = run(*args)
    assert (done.returncode, done.stdout) == (2, ""), done
    assert done.stderr.startswith("robot-dyn: error: ") and done.stderr.count("\n") == 1, done.stderr
    return done.stderr.removeprefix("robot-dyn: error: ").rstrip()
