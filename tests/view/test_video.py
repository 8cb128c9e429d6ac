"""A video shows the run at t = k / fps: by the page's own clock, in the file, and by the picture of each frame."""

from __future__ import annotations

import io
import re
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import robot_dyn as rd
from robot_dyn.foundations import VideoError
from robot_dyn.view.video import encoders
from robot_dyn.view.video.video import frame_times
from tests.browser import chromium, opened
from tests.command import said
from tests.long import long

SIZE = (320, 240)
FPS = 10


@pytest.fixture(scope="module")
def motion() -> rd.Trajectory:
    arm = rd.load("planar_2r")
    return rd.simulate(arm, q0=[0.4, -0.7], duration_s=0.5, record_every_s=0.01, estimate_error=False)


@pytest.fixture(scope="module")
def seen(browser: Any, motion: rd.Trajectory) -> list[np.ndarray]:
    """Pictures of the page at k / fps, by another driver of the browser; each shows its time and the run's state."""
    found = []
    with opened(browser, rd.replay(motion), size=SIZE, color_scheme="light") as view:
        view.page.evaluate("film.begin()")
        for k in range(6):
            assert view.page.evaluate("(t) => film.show(t)", k / FPS) == k / FPS == view.ask("replay.time")
            assert view.page.locator("#now").text_content() == f"{k / FPS:.3f} / 0.500 s"
            view.stands(rd.load("planar_2r"), motion.q[10 * k], "tip", within=2e-3)  # the page is thinned to 5e-4 rad
            found.append(_pixels(view.page.screenshot()))
    return found


def frames_of(shown: Any) -> int:
    """Pillow counts them in some formats alone."""
    return shown.n_frames


def _pixels(picture: bytes | Image.Image) -> np.ndarray:
    image = Image.open(io.BytesIO(picture)) if isinstance(picture, bytes) else picture
    return np.asarray(image.convert("RGB")).astype(int)


def _assert_the_same(frames: list[np.ndarray], seen: list[np.ndarray]) -> None:
    """Each frame is nearest to the picture of its own time, and near it: colours are compressed."""
    distance = np.array([[np.abs(frame - picture).mean() for picture in seen] for frame in frames])
    assert list(distance.argmin(axis=1)) == list(range(len(seen)))
    assert distance.diagonal().max() < 5


def test_each_frame_of_an_mp4_is_the_page_at_its_time(
    motion: rd.Trajectory, seen: list[np.ndarray], tmp_path: Path
) -> None:
    """From a thread with a running event loop, that of `seen`, as in a notebook."""
    import imageio_ffmpeg

    parts = []
    page = rd.replay(motion)
    file = page.save_video(
        tmp_path / "run.mp4", fps=FPS, size=SIZE, browser=chromium(), on_progress=lambda part, _: parts.append(part)
    )
    assert parts == pytest.approx([(k + 1) / 6 for k in range(6)])
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", file, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    decoded = subprocess.run(command, capture_output=True, check=True)
    assert f"320x240, {FPS} fps" in re.sub(r" \[.*?\]|[0-9.]+ kb/s, ", "", decoded.stderr.decode())
    _assert_the_same([*np.frombuffer(decoded.stdout, np.uint8).reshape(-1, *SIZE[::-1], 3).astype(int)], seen)


def test_each_frame_of_a_gif_is_the_page_at_its_time(
    motion: rd.Trajectory, seen: list[np.ndarray], tmp_path: Path
) -> None:
    """By the command, over an older one."""
    motion.save(tmp_path / "run.npz")
    (tmp_path / "run.gif").write_bytes(b"GIF89a")
    options = ("--video", tmp_path / "run.gif", "--fps", FPS, "--size", "320x240", "--force")
    assert f"written: {tmp_path / 'run.gif'}" in said("replay", tmp_path / "run.npz", *map(str, options))
    with Image.open(tmp_path / "run.gif") as shown:
        assert shown.size == SIZE and frames_of(shown) == 6
        frames = []
        for k in range(6):
            shown.seek(k)
            assert shown.info["duration"] == 100  # [ms]
            frames.append(_pixels(shown))
    _assert_the_same(frames, seen)


@given(st.integers(1, 240), st.integers(0, 5000))
def test_frames_are_at_k_over_fps_up_to_the_end(fps: int, last: int) -> None:
    """A run that ends at frame `last`, to rounding, has that frame; one that ends between two ends at the first."""
    for duration in (last / fps, np.nextafter(last / fps, 0.0), (last + 0.5) / fps):
        t = frame_times(float(duration), fps)
        assert len(t) == last + 1 and t[-1] <= duration
        np.testing.assert_allclose(t, np.arange(last + 1) / fps, rtol=1e-15, atol=0)


@pytest.mark.parametrize("fps", [30, *long([7, 50])])
def test_no_error_adds_up_in_the_times_of_a_gif(tmp_path: Path, fps: int) -> None:
    """Frame k begins within 1/200 s of k / fps."""
    pictures = []
    for k in range(60):
        stream = io.BytesIO()
        Image.new("RGB", (16, 12), "black" if k % 2 else "white").save(stream, "PNG")
        pictures.append(stream.getvalue())
    encoders.encode(pictures, tmp_path / "x.gif", (16, 12), fps)
    with Image.open(tmp_path / "x.gif") as shown:
        begins = [0.0]
        for k in range(frames_of(shown)):
            shown.seek(k)
            begins.append(begins[-1] + shown.info["duration"] / 1000)
    assert len(begins) == 61
    np.testing.assert_allclose(begins, np.arange(61) / fps, atol=0.005 + 1e-9)


REFUSED = {
    "fps must be a whole number, from 1 to 240": {"fps": 0},
    "from 1 to 50": {"path": "x.gif", "fps": 60},
    "fps must be": {"fps": 29.97},
    r"size\[1\] must be": {"size": (640, 100_000)},
    "even numbers": {"size": (641, 480)},
    "a width and a height": {"size": 640},
    "dark must be": {"dark": 1},
    "on_progress must be": {"on_progress": 1},
    "not a suffix": {"path": "x.webm"},
    "no folder": {"path": "nowhere/x.mp4"},
    "is not a program": {"browser": "nowhere/chrome"},
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_cannot_be_filmed_is_refused_before_the_work(motion: rd.Trajectory, tmp_path: Path, message: str) -> None:
    options = dict(REFUSED[message])
    path = tmp_path / options.pop("path", "x.mp4")
    with pytest.raises(VideoError, match=message):
        rd.replay(motion).save_video(path, **options)
    assert not list(tmp_path.iterdir())


def test_pages_without_time_and_films_without_end_are_refused(tmp_path: Path) -> None:
    arm = rd.load("planar_2r")
    with pytest.raises(VideoError, match="no run with a duration"):
        rd.show(arm).save_video(tmp_path / "x.mp4")
    short = rd.simulate(arm, [0.0, 0.0], duration_s=0.1, estimate_error=False)
    long = replace(short, t=1000.0 * short.t)
    with pytest.raises(VideoError, match="24000 frames, more than 20000"):
        rd.replay(long).save_video(tmp_path / "x.mp4", fps=240)
    with pytest.raises(VideoError, match="5000 frames of 1280 × 720 pixels are too many"):
        rd.replay(long).save_video(tmp_path / "x.gif", fps=50)


def test_ffmpeg_is_not_started_where_no_picture_comes(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    def without_a_browser() -> Iterator[bytes]:
        raise VideoError("none is installed")
        yield b""

    with pytest.raises(VideoError, match="none is installed"):
        encoders.encode(without_a_browser(), tmp_path / "run.gif", (320, 240), 25)
    assert not caplog.records
