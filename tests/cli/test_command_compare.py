"""What `compare` and `demo` say of the two implementations, and the exit code where they disagree."""

from __future__ import annotations

import json
import re

import pytest

from robot_dyn import Lagrangian
from tests.command import MAIN, ROOT, document, run, said, spawn


def test_compare_agrees():
    text = said("compare", "ur5", "--samples", "5")
    assert "1 of 1 agree" in text and "DISAGREE" not in text
    pendulum = ROOT / "urdf" / "pendulum.urdf"
    assert "2 of 2 agree" in said("compare", "pendulum", pendulum, "--samples", "3", "--seed", "5")


def test_compare_of_a_locked_robot():
    locked = document("compare", "panda", "--lock", "panda_finger_joint1=0.01", "--samples", "1")
    assert len(locked["robots"]["panda"]["quantities"]["N"]["state"]["q"]) == 7


def test_same_seed_same_states():
    first, again, other = (document("compare", "pendulum", "--samples", "2", "--seed", s) for s in ("3", "3", "4"))
    assert first == again != other


def test_piped_tables_are_whole():
    """A pipe has no width: no name is cut or wrapped."""
    text = said("compare", "panda", "--samples", "2")
    rows = [line for line in text.splitlines() if re.match(r"[MCN] +\d", line)]
    assert len(rows) == 3 and all(re.search(r"panda_(finger_)?joint\d", row) for row in rows)
    assert "…" not in text


def err_by(monkeypatch: pytest.MonkeyPatch, error: float) -> None:
    """Let the library's own implementation say a wrong N."""
    exact = Lagrangian.N
    monkeypatch.setattr(Lagrangian, "N", lambda self, q: exact(self, q) + error)


def test_compare_says_where_the_implementations_disagree(monkeypatch: pytest.MonkeyPatch):
    err_by(monkeypatch, 1e-9)
    done = run("compare", "ur5", "--samples", "2")
    assert (done.returncode, done.stderr) == (1, "")
    assert re.search(r"^N .*DISAGREE", done.stdout, re.M) and "0 of 1 agree" in done.stdout
    done = run("compare", "pendulum", "ur5", "--samples", "2", "--json")
    answer = json.loads(done.stdout)
    assert done.returncode == 1 and answer["ok"] is False
    assert answer["robots"]["ur5"]["quantities"]["N"]["ok"] is False
    assert answer["robots"]["ur5"]["quantities"]["M"]["ok"] is True


def test_a_process_of_compare_exits_with_1_when_the_implementations_disagree():
    wrong = "from robot_dyn.lagrange.lagrangian import Lagrangian as L; N = L.N; L.N = lambda self, q: N(self, q) + 1"
    done = spawn("compare", "pendulum", "--samples", "1", code=f"{wrong}\n{MAIN}")
    assert (done.returncode, done.stderr) == (1, b"") and b"DISAGREE" in done.stdout


def test_a_implementation_that_says_nan_disagrees_in_valid_json(monkeypatch: pytest.MonkeyPatch):
    err_by(monkeypatch, float("nan"))
    done = run("compare", "ur5", "--samples", "1", "--json")
    assert done.returncode == 1
    assert json.loads(done.stdout, parse_constant=pytest.fail)["robots"]["ur5"]["quantities"]["N"]["error"] is None
