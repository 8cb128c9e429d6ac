"""Ctrl-C at any moment of a command: exit code 130, one line, no traceback."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import robot_dyn as rd
from robot_dyn.codegen.waiting import interrupts_later
from tests.long import long

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")

READY = """
import signal, sys
from robot_dyn.cli import interrupts, main
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets what it runs in the background ignore it
interrupts.guard()
print("ready", file=sys.stderr, flush=True)
main()
"""
SCENE = """
robot = "ur5"
duration_s = 1000.0
method = "{method}"
engine = "interpreted"
estimate_error = {estimate}
"""
DELAYS = [0.03 * k**1.5 for k in range(20)]  # [s]: from the first import to the run, on this machine or a slower one


def interrupted(delays: list[float], *args: str | Path, code: str = READY) -> Iterator[tuple[int, str, str]]:
    """Exit code, output and errors of a command that is interrupted after each of some delays; five run at a time."""
    for some in (delays[k : k + 5] for k in range(0, len(delays), 5)):
        children = []
        for _ in some:
            command = [sys.executable, "-c", code, *map(str, args)]
            child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8")
            assert child.stderr is not None and child.stderr.readline() == "ready\n"
            children.append(child)
        began = time.perf_counter()
        for delay, child in zip(some, children, strict=True):
            time.sleep(max(0.0, delay - (time.perf_counter() - began)))
            child.send_signal(signal.SIGINT)
        for child in children:
            out, err = child.communicate(timeout=60)
            yield child.returncode, out, err


@pytest.mark.parametrize(
    ("method", "estimate", "delays"),
    [("DOP853", "true", DELAYS[2::6]), *long([("DOP853", "true", DELAYS[::4]), ("Rodas5P", "false", DELAYS[1::2])])],
)
def test_a_run_may_be_interrupted_at_any_moment(method: str, estimate: str, delays: list, tmp_path: Path) -> None:
    """While it imports, reads, runs: it would take minutes by itself."""
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.format(method=method, estimate=estimate))
    for code, out, err in interrupted(delays, "simulate", scene):
        assert code == 130, (out, err)
        assert err == "robot-dyn: interrupted\n"
        assert out == "" or out.startswith("stopped at t = ")


@pytest.fixture
def raised() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt."""
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, handler)


def test_an_interrupt_while_machine_code_is_made_comes_after_it(raised: None) -> None:
    seen = []
    with pytest.raises(KeyboardInterrupt):
        with interrupts_later():
            signal.raise_signal(signal.SIGINT)
            seen.append("made")
        seen.append("never")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert seen == ["made"]


def test_an_interrupt_during_a_trace_comes_after_it(raised: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """NumPy calls the operators of symbols back from C, where no exception can be raised."""
    from robot_dyn.codegen.trace import symbol

    made, calls = symbol._symbol, []

    def interrupting(x: object) -> object:
        calls.append(x)
        if len(calls) == 20:
            signal.raise_signal(signal.SIGINT)
        return made(x)

    monkeypatch.setattr(symbol, "_symbol", interrupting)
    monkeypatch.setenv("ROBOT_DYN_CACHE", "off")
    robot = rd.load("planar_2r").with_(mass_scale=1.0123)  # none that is compiled already
    with pytest.raises(KeyboardInterrupt):
        rd.simulate(rd.Plant(robot), q0=[0.3, -0.4], duration_s=0.01, engine="compiled")
    assert len(calls) > 20


def test_an_interrupt_comes_too_where_nothing_can_be_made(raised: None) -> None:
    """Machine code that ends in an error, as of a part that cannot be traced, does not take the interrupt with it."""
    with pytest.raises(KeyboardInterrupt), interrupts_later():
        signal.raise_signal(signal.SIGINT)
        raise rd.RobotDynError("cannot be traced")


AT_IMPORT = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.argv = ["robot-dyn", "list"]
class Interrupt:
    def find_spec(self, name, *_):
        if name == {module!r}:
            signal.raise_signal(signal.SIGINT)
sys.meta_path.insert(0, Interrupt())
from robot_dyn.cli import main
main()
"""


@pytest.mark.parametrize(
    "module", ["robot_dyn.cli.interrupts", "typer.main", "robot_dyn.cli.application", "robot_dyn.foundations.errors"]
)
def test_an_interrupt_at_the_first_imports_ends_in_one_line(module: str) -> None:
    command = [sys.executable, "-c", AT_IMPORT.format(module=module)]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", timeout=60, check=False)
    ended = done.returncode == 0 and module != "robot_dyn.cli.interrupts"  # the command may end before it
    assert ended or done.returncode == 130
    assert done.stderr == ("" if ended else "robot-dyn: interrupted\n")


def test_importing_the_command_line_leaves_the_handlers_of_a_program() -> None:
    code = "import signal, robot_dyn.cli; print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8", timeout=60, check=False)
    assert done.stdout == "True\n" or signal.getsignal(signal.SIGINT) is signal.SIG_IGN
