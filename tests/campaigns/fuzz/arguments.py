"""Command lines: valid ones with words changed, doubled, left out or odd. A command ends with a code, in few lines."""

from __future__ import annotations

import io
import os
import signal
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from unittest import mock

import numpy as np

from robot_dyn.scene import starter
from tests.campaigns.fuzz.bytes import WORDS

CODES = (0, 1, 2)
LINES = (
    "list --json",
    "info planar_2r --lock joint_1=0.1 --json",
    "query cart_pole --q 0.1,0.2 --v slide=1 --a 1,2 --payload pole=1kg@0,0,0.1 --why hinge --json",
    "query planar_2r --tau 1,2 --effects urdf --package-dir .",
    "compare pendulum planar_2r --samples 1 --seed 3",
    "simulate scene.toml -o out.npz --csv out.csv --force --json",
    "explain scene.toml",
    "parameters scene.toml --json",
    "scene pendulum",
    "plot run.npz -o out.svg --only energy --joint slide --width-mm 120 --dark --force",
    "replay run.npz --html out.html --force --frame pole",
    "cache --json",
    "--version",
    "--help",
)
ODD = (
    *WORDS, "scene.toml", "run.npz", ".", "/", "/dev/full", "pipe", "--json", "--", "-h", "joint_1=nan", "1,2,3",
    "--force",
)  # fmt: skip


def seeds(folder: Path) -> list[list[str]]:
    """Command lines, with the files that they name."""
    import robot_dyn as rd

    scene = folder / "scene.toml"
    scene.write_text(starter("cart_pole").replace("4.0", "0.02", 1), encoding="utf-8")
    rd.simulate(rd.read_scene(scene)).save(folder / "run.npz")
    if os.name == "posix":
        os.mkfifo(folder / "pipe")
    return [line.split() for line in LINES]


def mutate(rng: np.random.Generator, seed: list[str]) -> list[str]:
    words = list(seed)
    for _ in range(int(rng.integers(1, 3))):
        i = int(rng.integers(0, len(words) + 1))
        odd = ODD[int(rng.integers(len(ODD)))].replace("\0", "\x01")  # no system hands a NUL over
        match int(rng.integers(4)):
            case 0:
                words.insert(i, odd)
            case 1:
                words[i : i + 1] = [odd]
            case 2:
                del words[i : i + 1]
            case _:
                words[i : i + 1] = words[i : i + 1] * 2
    # A live server and a run of hours do not hang.
    return words if "replay" not in words or "--html" in words else ["--help"]


def attempt(mutant: list[str], folder: Path) -> str:
    from robot_dyn.cli import main

    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", write_through=True) for _ in range(2))
    before, handler = Path.cwd(), signal.getsignal(signal.SIGINT)
    os.chdir(folder)
    scene = (folder / "scene.toml").read_bytes()
    try:
        with mock.patch.object(sys, "argv", ["robot-dyn", *mutant]), redirect_stdout(out), redirect_stderr(err):
            main()
    except SystemExit as end:
        code = end.code or 0
    finally:
        os.chdir(before)
        signal.signal(signal.SIGINT, handler)  # the command leaves it ignored, as the last act of a process
    told = err.buffer.getvalue().decode()
    assert code in CODES, (code, mutant)
    assert "Traceback" not in told, (told, mutant)
    assert code != 2 or told or not mutant, mutant  # without words the help is shown
    assert (folder / "scene.toml").read_bytes() == scene, mutant
    return "refused" if code == 2 else "accepted"
