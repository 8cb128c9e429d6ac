"""A page as a value: a notebook displays it; at a prompt, its `repr` is an address for a browser."""

from __future__ import annotations

import sys
from base64 import b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from tempfile import mkdtemp
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, final

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.files import FileKind, save, target, why
from robot_dyn.foundations.validate import integer
from robot_dyn.view.picture import HEIGHT, WIDTH, picture
from robot_dyn.view.web.text import page_text

if TYPE_CHECKING:
    from robot_dyn.view.server import Server

_HEIGHT = 720  # height of a page in a notebook, in pixels
PAGE = FileKind("a page", ".html", b"<!DOCTYPE html>")


class ReplayError(RobotDynError):
    """A replay that cannot be built or written."""


@final
@dataclass(frozen=True, eq=False, repr=False)
class Page:
    """A page of `replay` or `show`, which needs neither server nor network.

    A notebook shows the page if it is the last value of a cell: in a frame without access to the notebook or, where
    frames are removed, as a picture of its start. At a prompt, `repr` returns its address.

    Attributes:
        document: Contents of the page, for its script.
    """

    document: Mapping[str, Any]

    def __post_init__(self) -> None:
        object.__setattr__(self, "document", MappingProxyType(dict(self.document)))

    def __reduce__(self) -> tuple[Any, ...]:
        return Page, (dict(self.document),)

    @cached_property
    def text(self) -> str:
        """HTML of the page."""
        return page_text(self.document)

    @cached_property
    def address(self) -> str:
        """Address (file:) of a copy in a temporary folder, which is written on first access.

        Raises:
            ReplayError: If it cannot be written.
        """
        try:
            folder = Path(mkdtemp(prefix="robot_dyn-"))  # readable for the owner only
        except OSError as cause:
            raise ReplayError(f"no temporary folder ({why(cause)}); write the page with .save(path)") from None
        return self.save(folder / "page.html").as_uri()

    def save(self, path: str | Path) -> Path:
        """Write the page as one HTML file; only an older page may be replaced.

        Raises:
            ReplayError: If the file cannot be written.
        """
        file, content = target(path, PAGE, ReplayError), self.text.encode()
        return save(file, lambda stream: stream.write(content), ReplayError)

    def save_video(
        self,
        path: str | Path,
        *,
        fps: int | None = None,
        size: tuple[int, int] = (1280, 720),
        dark: bool = False,
        browser: str | Path | None = None,
        on_progress: Callable[[float, str], object] | None = None,
    ) -> Path:
        """Write the run as a video, .mp4 or .gif: frame k shows t = k / fps, by the clock of the page.

        An installed Chrome, Chromium or Edge draws it, without a window, a network or an open port; WebGL runs on the
        CPU. Number, times and states of the frames are those of the page; pixels depend on the browser. An existing
        video of that name is replaced. It needs `pip install 'robot-dyn[video]'`.

        Args:
            path: The file.
            fps: Frames per second, up to 240, or 50 for a .gif. By default 60 for an .mp4 and 25 for a .gif.
            size: Width and height in pixels, even numbers from 160 to 3840.
            dark: True to draw it for dark screens.
            browser: Path of the browser; by default the first one installed.
            on_progress: Called in another thread with the finished fraction, from 0 to 1, and the name of the task.

        Raises:
            VideoError: If the page has no run, the video is too long, no installed browser shows the page, or the
                file cannot be written.
            MissingExtraError: If playwright or imageio-ffmpeg is not installed.
        """
        from robot_dyn.view.video.video import save_video  # starts no browser

        text, duration = self.text, self.document["duration"]
        return save_video(text, duration, path, fps, size, dark, browser, on_progress)

    def serve(self, port: int | None = None) -> Server:
        """Serve the page on this machine only, at the `url` of the returned server, until the server is closed.

        Args:
            port: Port to listen on; by default any free port.

        Raises:
            QueryError: If the port is not a whole number from 1 to 65535.
            ServerError: If the port is taken.
        """
        port = None if port is None else integer("port", port, least=1, most=65535)
        from robot_dyn.view.server import Server  # takes 30 ms to import

        return Server(self.text, port)

    def __repr__(self) -> str:
        return f"<{self._title}: {self.address}>"

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, Any]:
        """Return the page in a frame, its picture, and a line of text, which has an address only in a terminal."""
        still = b64encode(picture(self.document)).decode()
        text = repr(self) if sys.stdout.isatty() else f"<{self._title}: .address is a page, .save(path) writes it>"
        return {"text/html": self._frame(still), "image/png": still, "text/plain": text}

    def _frame(self, still: str) -> str:
        """Return a frame with the page; viewers that remove frames but keep their content show the picture."""
        title = escape(self._title)
        return (
            f'<iframe title="{title}" sandbox="allow-scripts allow-downloads" width="100%" height="{_HEIGHT}"'
            f' style="border:0" srcdoc="{escape(self.text)}">'
            f'<img alt="{title}" width="{WIDTH}" height="{HEIGHT}" src="data:image/png;base64,{still}"></iframe>'
        )

    @property
    def _title(self) -> str:
        return f"{self.document['title']}: {self.document['outcome']}"
