"""Pictures of a page at given times by an installed browser without a window, driven by Playwright over pipes.

The browser has no network and listens on no port; it ends with the program, even if that is killed.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from robot_dyn.foundations.errors import VideoError, shorten
from robot_dyn.foundations.extras import needs
from robot_dyn.foundations.files import file_path

_PATIENCE_MS = 120_000.0  # timeout; starting a browser from a slow disk takes tens of seconds
_NAMES = (
    "google-chrome", "google-chrome-stable", "chromium", "chromium-browser", "chrome", "microsoft-edge",
    "microsoft-edge-stable",
)  # fmt: skip
_PROGRAMS = ("/Applications/Chromium.app/Contents/MacOS/Chromium",)  # browsers without a channel, on macOS
_CHANNELS = ("chrome", "msedge")  # browsers that are not on the path
# WebGL on the CPU, so that pictures do not depend on a graphics card; no network.
_FLAGS = [
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--host-resolver-rules=MAP * ~NOTFOUND",
    "--disable-quic", "--font-render-hinting=none",
]  # fmt: skip


def playwright() -> Any:
    """Return Playwright's synchronous interface.

    Raises:
        MissingExtraError: If it is not installed.
    """
    return needs("playwright.sync_api", extra="video")


def installed(path: str | Path | None = None) -> Path | None:
    """Return the program of a browser: `path`, or the first on the path or at a known place; None if there is none.

    Raises:
        VideoError: If the file at `path` cannot be run.
    """
    if path is None:
        found = next(filter(None, map(shutil.which, (*_NAMES, *_PROGRAMS))), None)
        return None if found is None else Path(found)
    program = file_path(path, VideoError)
    if not (program.is_file() and os.access(program, os.X_OK)):
        raise VideoError(f"{program}: is not a program; give the path of Chrome, Chromium or Edge")
    return program.absolute()


def frames(
    program: Path | None, text: str, times: np.ndarray, size: tuple[int, int], dark: bool
) -> Generator[bytes, None, None]:
    """Yield pictures (PNG) of a page, of a size in pixels, at times; the browser ends with the last one.

    Raises:
        VideoError: If the browser does not start or show the page, or shows another time.
    """
    api, temporary = playwright(), TemporaryDirectory(prefix="robot_dyn-", ignore_cleanup_errors=True)
    try:
        with (
            temporary as folder,
            _driver(api, folder) as driver,
            _launched(driver.chromium, program, folder, api.Error) as browser,
        ):
            width, height = size
            scheme = "dark" if dark else "light"
            page = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme, offline=True)
            page.set_default_timeout(_PATIENCE_MS)
            page.set_content(text)
            page.wait_for_function("() => window.film")
            page.evaluate("film.begin()")
            for t in times.tolist():
                if (shown := page.evaluate("(t) => film.show(t)", t)) != t:
                    raise VideoError(f"the page shows t = {shown} s instead of {t} s")
                yield page.screenshot()
    except api.Error as error:
        first, said = str(error).splitlines()[0].partition(": ")[2], re.findall(r"\[err\] (.*)", str(error))
        told = f"its last message: {shorten(said[-1])}" if said else "it must be from 2023 or later"
        raise VideoError(f"{program or 'the browser'}: {shorten(first)}; {told}") from None


@contextmanager
def _driver(api: Any, folder: str) -> Iterator[Any]:
    """Start and end Playwright, with a folder for its temporary files, which remain after a failed launch."""
    names = ("TMPDIR", "TEMP", "TMP")
    before = {name: os.environ.get(name) for name in names}
    driver = api.sync_playwright()
    os.environ.update(dict.fromkeys(names, folder))  # Playwright has no option for it
    try:
        started = driver.start()
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})
    try:
        yield started
    finally:
        started.stop()


def _launched(chromium: Any, program: Path | None, folder: str, error: type[Exception]) -> Any:
    """Return the running browser; its temporary files are in a folder."""
    sandbox = not hasattr(os, "geteuid") or os.geteuid() != 0  # with one, browsers do not start for root
    environment = os.environ | {"TMPDIR": folder}
    options = {"args": _FLAGS, "chromium_sandbox": sandbox, "timeout": _PATIENCE_MS, "env": environment}
    if program is not None:
        return chromium.launch(executable_path=program, **options)
    for channel in _CHANNELS:
        try:
            return chromium.launch(channel=channel, **options)
        except error as cause:
            if "not found" not in str(cause):
                raise
    raise VideoError(
        "a video needs Chrome, Chromium or Edge, but none was found; install one, for example by apt-get install"
        " chromium or brew install --cask google-chrome, or give its path by save_video(…, browser=…)"
    )
