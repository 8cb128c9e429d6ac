"""The browser that draws videos: it listens nowhere, ends with the program however that ends, and leaves no file."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import VideoError
from robot_dyn.view.video import browser
from tests.browser import chromium
from tests.command import AT_WORK, interrupted_at_work, started

pytestmark = pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="processes are read from /proc")

# Says that it is at work when two frames are drawn; the third is drawn again and again until it is ended.
WATCHED = """
import time
from robot_dyn.view.video import video
whole = video.frames
def frames(*given):
    for k, picture in enumerate(whole(*given)):
        yield picture
        if k == 2:
            tell()
            for _ in range(600):
                time.sleep(0.1)
                yield picture
video.frames = frames
"""


@pytest.fixture
def run_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A run; temporary files have a folder of their own, of a short name: browsers put a socket there."""
    monkeypatch.setenv("PATH", f"{Path(chromium()).parent}:/bin:/usr/bin")
    arm = rd.load("planar_2r")
    file = rd.simulate(arm, [0.4, -0.7], duration_s=1.0, estimate_error=False).save(tmp_path / "run.npz")
    with TemporaryDirectory(prefix="t") as folder:
        monkeypatch.setenv("TMPDIR", folder)
        yield file


def of_browser(folder: Path) -> list[int]:
    """Processes that have the folder in their command line, as browsers have their profile."""
    found = []
    for each in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if f"user-data-dir={folder}".encode() in (each / "cmdline").read_bytes():
                found.append(int(each.name))
    return found


def listening() -> Iterator[str]:
    """Sockets of this machine that listen for TCP, as the links of their descriptors name them."""
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            if line.split()[3] == "0A":
                yield f"socket:[{line.split()[9]}]"


def sockets(process: int) -> Iterator[str]:
    for each in Path(f"/proc/{process}/fd").iterdir():
        with suppress(OSError):
            yield os.readlink(each)


def gone(folder: Path) -> bool:
    end = time.monotonic() + 20
    while of_browser(folder) and time.monotonic() < end:
        time.sleep(0.05)
    return not of_browser(folder)


def test_ctrl_c_leaves_no_file_and_no_browser(run_file: Path) -> None:
    temporary, video = Path(os.environ["TMPDIR"]), run_file.with_name("run.gif")
    interrupted_at_work("replay", run_file, "--video", video, "--size", "320x240", watched=WATCHED)
    assert not of_browser(temporary)
    assert not list(temporary.iterdir())
    assert list(run_file.parent.iterdir()) == [run_file]


def test_the_browser_listens_nowhere_and_ends_with_a_program_that_is_killed(run_file: Path) -> None:
    temporary = Path(os.environ["TMPDIR"])
    args = ("replay", run_file, "--video", run_file.with_name("run.gif"), "--size", "320x240")
    with started(*args, code=AT_WORK.format(WATCHED)) as process:
        assert process.stderr is not None and process.stderr.readline() == "at work\n"
        browsers = of_browser(temporary)
        assert browsers
        assert not {each for number in browsers for each in sockets(number)} & set(listening())
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert gone(temporary)


def filmed(program: Path | None) -> None:
    """A page without a run."""
    list(browser.frames(program, "<p>", np.zeros(1), (320, 240), False))


def test_without_a_browser_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(browser, "_CHANNELS", ())
    with ThreadPoolExecutor(1) as pool, pytest.raises(VideoError, match=r"but none was found; install .*chrom"):
        pool.submit(filmed, browser.installed()).result()


def test_chromium_in_the_folder_of_applications_is_found_after_the_path(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "bin").mkdir()
    application, on_path = tmp_path / "Chromium", tmp_path / "bin" / "chromium"
    monkeypatch.setenv("PATH", str(on_path.parent))
    monkeypatch.setattr(browser, "_PROGRAMS", (str(application),))
    for program in (application, on_path):
        program.write_text("#!/bin/sh\n")
        program.chmod(0o700)
        assert browser.installed() == program


@pytest.mark.parametrize(
    ("script", "patience_ms", "message"),
    [
        ("echo no display >&2; exit 1", 20e3, "has been closed; its last message: no display"),
        ("sleep 60", 500.0, "500ms"),
    ],
)
def test_a_program_that_is_no_browser_is_named_and_ended(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, script: str, patience_ms: float, message: str
) -> None:
    program = tmp_path / "chrome"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o700)
    (temporary := tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr(browser, "_PATIENCE_MS", patience_ms)
    with ThreadPoolExecutor(1) as pool, pytest.raises(VideoError, match=f"{program}: .*{message}"):
        pool.submit(filmed, program).result()
    assert not list(temporary.iterdir()) and os.environ["TMPDIR"] == str(temporary)
    with suppress(FileNotFoundError):
        assert not [each for each in Path("/proc").glob("[0-9]*") if str(program).encode() in _command(each)]


def _command(process: Path) -> bytes:
    try:
        return (process / "cmdline").read_bytes()
    except OSError:
        return b""
