"""Frames: the page at times t_k = k / fps, k = 0, …, ⌊T fps⌋, by its own clock, each as a picture.

Number, times and states of the frames follow from the page; pixels depend on the browser and its fonts.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator
from math import floor
from time import monotonic, sleep

import numpy as np

from robot_dyn.foundations.errors import VideoError
from robot_dyn.view.video.browser import Browser

_ROUNDING = 1e-9  # of a frame: T fps is a whole number up to this
_LOAD_S = 120.0
_PAUSE_S = 0.05


def frame_times(duration_s: float, fps: int) -> np.ndarray:
    """Times of the frames, in [s]; the last is at most the duration."""
    count = floor(duration_s * fps + _ROUNDING) + 1
    return np.minimum(np.arange(count) / fps, duration_s)


def load(tab: Browser, text: str, size: tuple[int, int], dark: bool) -> None:
    """Show a page of a size in pixels, ready to be filmed.

    Raises:
        VideoError: If the browser cannot show it.
    """
    width, height = size
    tab.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
    scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
    tab.call("Emulation.setEmulatedMedia", features=[scheme])
    frame = tab.call("Page.getFrameTree")["frameTree"]["frame"]["id"]
    tab.call("Page.setDocumentContent", frameId=frame, html=text)
    until = monotonic() + _LOAD_S
    while not tab.ask("!!window.film"):
        if monotonic() > until:
            raise VideoError("the page is not shown; the browser must be of 2023 or later")
        sleep(_PAUSE_S)
    tab.ask("film.begin()")


def frames(tab: Browser, times: np.ndarray) -> Iterator[bytes]:
    """The pictures of a loaded page at times, as PNG files.

    Raises:
        VideoError: If the page shows another time.
    """
    for t in times.tolist():
        if (shown := tab.ask(f"film.show({t!r})")) != t:
            raise VideoError(f"the page shows t = {shown} s in place of {t} s")
        picture = tab.call("Page.captureScreenshot", format="png", optimizeForSpeed=True)
        yield base64.b64decode(picture["data"])
