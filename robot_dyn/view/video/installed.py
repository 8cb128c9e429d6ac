"""The browser of this machine: Chrome, Chromium or Edge, on the path or where the system puts applications."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

from robot_dyn.foundations.errors import VideoError
from robot_dyn.foundations.files import file_path

_NAMES = (
    "google-chrome", "google-chrome-stable", "chromium", "chromium-browser", "chrome", "microsoft-edge",
    "microsoft-edge-stable",
)  # fmt: skip
_APPLICATIONS = tuple(
    Path(f"/Applications/{name}.app/Contents/MacOS/{name}") for name in ("Google Chrome", "Chromium", "Microsoft Edge")
)
_HOW = {"darwin": "brew install --cask google-chrome"}


def installed(path: str | Path | None = None) -> Path:
    """The program of a browser: the one at `path`, or the first that this machine has.

    Raises:
        VideoError: If there is none, or none that can be run at `path`.
    """
    if os.name != "posix":
        raise VideoError("videos are made on Linux and macOS alone; .save(path) writes the page")
    if path is not None:
        program = file_path(path, VideoError)
        if not (program.is_file() and os.access(program, os.X_OK)):
            raise VideoError(f"{program}: is not a program; give the path of Chrome, Chromium or Edge")
        return program.absolute()
    on_path = (shutil.which(name) for name in _NAMES)
    applications = (str(each) for each in _APPLICATIONS if os.access(each, os.X_OK))
    found = next((each for each in (*on_path, *applications) if each), None)
    if found is None:
        how = _HOW.get(sys.platform, "apt-get install chromium")
        raise VideoError(
            f"a video is drawn by Chrome, Chromium or Edge, and none is installed: {how}; if it has another name, give"
            " its path by save_video(…, browser=…)"
        )
    return Path(found)
