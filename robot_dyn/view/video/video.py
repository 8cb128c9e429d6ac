"""A video of a page: checks, then the browser, the frames and the encoder; the file is written at the end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from math import floor
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryDirectory
from threading import Event

import numpy as np

from robot_dyn.foundations.errors import VideoError
from robot_dyn.foundations.files import FileKind, save, target
from robot_dyn.foundations.validate import function, integer, truth
from robot_dyn.view.video import encoders
from robot_dyn.view.video.browser import frames, installed, playwright

KINDS = FileKind("an MP4 video", ".mp4", b"\0\0\0"), FileKind("a GIF", ".gif", b"GIF8")
_FPS, _MAX_FPS = {".mp4": 60, ".gif": 25}, {".mp4": 240, ".gif": 50}  # browsers slow down faster GIFs
_MAX_FRAMES = 20_000
_ROUNDING = 1e-9  # fraction of a frame by which T · fps may differ from a whole number
_MAX_PIXELS = 5 * 10**8  # pixels of a GIF; its frames take 4.5 bytes per pixel in memory
_MIN_SIZE, _MAX_SIZE = 160, 3840


def save_video(
    text: str,
    duration_s: float,
    path: str | Path,
    fps: int | None,
    size: tuple[int, int],
    dark: bool,
    program: str | Path | None,
    on_progress: Callable[[float, str], object] | None,
) -> Path:
    """Write the video of a page, given as its text; for arguments and errors, see `Page.save_video`."""
    file = target(path, KINDS, VideoError)
    kind = file.suffix.lower()
    rate = integer("fps", _FPS[kind] if fps is None else fps, least=1, most=_MAX_FPS[kind], error=VideoError)
    size, dark = _checked_size(size), truth("dark", dark, error=VideoError)
    function("on_progress", on_progress, "a part and a text", error=VideoError)
    times = _checked_times(duration_s, rate, kind, size)
    found, stop = installed(program), Event()
    playwright()  # raises before the work, as the next
    encoders.ffmpeg()
    with TemporaryDirectory(prefix="robot_dyn-") as folder:
        video = Path(folder) / f"video{kind}"

        def film() -> None:
            with closing(frames(found, text, times, size, dark)) as pictures:
                encoders.encode(_reported(pictures, len(times), on_progress, stop), video, size, rate)

        with ThreadPoolExecutor(1) as pool:  # Playwright refuses threads with a running event loop, as notebooks have
            try:
                pool.submit(film).result()
            finally:
                stop.set()  # Ctrl-C comes to this thread
        with video.open("rb") as content:
            return save(file, lambda stream: copyfileobj(content, stream), VideoError)


def frame_times(duration_s: float, fps: int) -> np.ndarray:
    """Return times of the frames, in [s]; the last is at most the duration."""
    count = floor(duration_s * fps + _ROUNDING) + 1
    return np.minimum(np.arange(count) / fps, duration_s)


def _checked_size(size: tuple[int, int]) -> tuple[int, int]:
    if not isinstance(size, tuple | list) or len(size) != 2:
        raise VideoError(f"size must be a width and a height in pixels, got {size!r}")
    width, height = (
        integer(f"size[{k}]", pixels, least=_MIN_SIZE, most=_MAX_SIZE, error=VideoError)
        for k, pixels in enumerate(size)
    )
    if width % 2 or height % 2:
        raise VideoError(
            f"size must have even numbers, got {width} and {height}; videos halve the resolution of colours"
        )
    return width, height


def _checked_times(duration_s: float, fps: int, kind: str, size: tuple[int, int]) -> np.ndarray:
    """Return the times of the frames; raise a VideoError if their number or size is not allowed."""
    if not duration_s > 0:
        raise VideoError("the page has no run with a duration, so there is no video; save the page by .save(path)")
    count = duration_s * fps
    if count > _MAX_FRAMES:
        raise VideoError(
            f"{duration_s:g} s at {fps} frames per second are {count:.0f} frames, more than {_MAX_FRAMES}; use a lower"
            " frame rate"
        )
    if kind == ".gif" and count * size[0] * size[1] > _MAX_PIXELS:
        raise VideoError(
            f"{count:.0f} frames of {size[0]} × {size[1]} pixels are too many for a .gif; use a lower frame rate, a"
            " smaller size, or an .mp4"
        )
    return frame_times(duration_s, fps)


def _reported(
    pictures: Iterable[bytes], count: int, on_progress: Callable[[float, str], object] | None, stop: Event
) -> Iterator[bytes]:
    for k, picture in enumerate(pictures):
        if stop.is_set():
            return
        yield picture
        if on_progress is not None:
            on_progress((k + 1) / count, "drawing frames")
