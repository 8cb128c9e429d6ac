"""Commands that show a robot or a run: show, replay, plot."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, final

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments
from robot_dyn.cli.application import INSPECTION, bar, command
from robot_dyn.cli.options import AS_STATED, Dark, Force, Name, Positions, RobotOptions
from robot_dyn.cli.terminal import say, say_written
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.files import target

if TYPE_CHECKING:
    from robot_dyn.view.page import Page


@final
@dataclass(frozen=True)
class PageOptions:
    """Options of a page: how it is drawn, and whether it is written or served.

    Options:
        html (OUT.html): Write one file that needs no server, and exit.
        inertia: Draw each link's equivalent inertia box.
        meshes: full (all triangles of the files) or coarse (fewer, for a smaller page).
        port: Port of the server; a free one by default.
        open_: Open the page in your browser.
    """

    html: str | None = None
    inertia: bool = False
    meshes: str = "full"
    port: Annotated[int | None, typer.Option(min=1, max=65535)] = None
    open_: bool = False
    force: Force = False

    @property
    def appearance(self) -> Any:
        """Arguments of `rd.show` and `rd.replay`."""
        return {"inertia": self.inertia, "meshes": self.meshes}

    def file(self, inputs: list[str]) -> Path | None:
        """Return the file to write, checked; None if the page is served."""
        from robot_dyn.view.page import PAGE, ReplayError

        if self.html is not None and self.port is not None:
            raise QueryError("give --html or --port, not both; a file needs no server")
        return None if self.html is None else target(self.html, PAGE, ReplayError, inputs, self.force)

    def write_or_serve(self, page: Page, file: Path | None, content: str) -> None:
        """Write a page to a file, or serve it until Ctrl-C."""
        if file is not None:
            with bar(description="writing the page"):
                page.save(file)
            self.report_written(file)
            return
        with page.serve(self.port) as server, suppress(KeyboardInterrupt):
            say(f"{server.url} shows the {content}; Ctrl-C ends it")
            self._open(server.url)
            server.wait()

    def report_written(self, file: Path) -> None:
        """Print the path of a written file, and open it in the browser if `open_` is True."""
        say_written(file)
        self._open(file.absolute().as_uri())

    def _open(self, address: str) -> None:
        if self.open_:
            import webbrowser

            webbrowser.open(address)


SERVED = PageOptions()


@command(INSPECTION, "show")
def show_(robot: Name, /, q: Positions = None, view: PageOptions = SERVED, options: RobotOptions = AS_STATED) -> None:
    """Show a robot in the browser, or as one HTML file.

    Without --html, a server on this machine runs until Ctrl-C.
    """
    file = view.file([robot])
    loaded = options.load(robot)
    at = arguments.vector("--q", q, loaded.joint_names)
    view.write_or_serve(rd.show(loaded, at, package_dirs=options.package_dir or (), **view.appearance), file, "robot")


@command(INSPECTION)
def replay(
    runs: list[str],
    /,
    video: str | None = None,
    fps: int | None = None,
    size: str | None = None,
    dark: Dark = False,
    frame: str | None = None,
    name: list[str] | None = None,
    view: PageOptions = SERVED,
    package_dir: list[str] | None = None,
) -> None:
    """Replay runs in the browser, or as one HTML file or a video.

    Without --html and --video, a server on this machine runs until Ctrl-C.

    Options:
        runs (RUN.npz...): Run files; all but the first are drawn transparent.
        video (OUT.mp4): Write an .mp4 or .gif, drawn by an installed Chrome, Chromium or Edge.
        fps: Frames per second of the video; frame k shows t = k / fps. Default 60, or 25 for a .gif.
        size (WIDTHxHEIGHT): Pixels of the video; 1280x720 by default.
        frame (LINK): Link whose path is drawn; the tip by default.
        name: Name of a run in titles and legends, one for each run; repeat it.
        package_dir: Folder in which ROS packages are searched; may be repeated.
    """
    file = view.file(runs)
    film = None if video is None else _film(video, size or "1280x720", view, runs)
    if film is None and (dark or size is not None or fps is not None):
        raise QueryError(
            "--dark, --size and --fps apply to videos only; add --video OUT.mp4, or remove them: a page follows the"
            " dark mode of the browser"
        )
    trajectories = map(arguments.run, runs)
    page = rd.replay(*trajectories, frame=frame, names=name, package_dirs=package_dir or (), **view.appearance)
    if film is None:
        view.write_or_serve(page, file, "run")
        return
    path, pixels = film
    with bar(1.0, description="starting the browser", at_the_end="writing") as advance:
        page.save_video(path, fps=fps, size=pixels, dark=dark, on_progress=advance)
    view.report_written(path)


@command(INSPECTION)
def plot(
    run: str,
    /,
    output: str | None = None,
    only: list[str] | None = None,
    joint: list[str] | None = None,
    width_mm: float = 180.0,
    paper: bool = False,
    dark: Dark = False,
    force: Force = False,
) -> None:
    """Draw a run: joints, torques, energy, tracking, phase, error.

    Options:
        run (RUN.npz): A run file written by `robot-dyn simulate … -o`.
        output (PLOT.png): A .png, .svg or .pdf; RUN.png by default.
        only (PART): overview, joints, torques, energy, tracking, phase or error_growth; may be repeated; by
            default the overview.
        joint (JOINT): Show only this joint; may be repeated.
        width_mm: Width in mm; text keeps its size.
        paper: For a paper: thin lines, no title, legible in grey.
    """
    from robot_dyn.view.plots.pictures import PICTURES, PlotError

    path = target(output or Path(run).with_suffix(".png"), PICTURES, PlotError, [run], force)
    look = {"theme": "dark" if dark else "light", "style": "paper" if paper else "screen", "width_mm": width_mm}
    with bar(description="drawing"):
        rd.plot(rd.read(run), only=only or (), joints=joint or None, **look).save(path)
    say(f"written: {path}")


def _film(video: str, size: str, view: PageOptions, inputs: list[str]) -> tuple[Path, tuple[int, int]]:
    """Return the video to write, checked, and its size in pixels."""
    from robot_dyn.foundations.errors import VideoError
    from robot_dyn.view.video.video import KINDS

    if view.html is not None or view.port is not None:
        raise QueryError("give only one of --video, --html and --port")
    if not re.fullmatch("[0-9]+x[0-9]+", size):
        raise QueryError(f"--size must be WIDTHxHEIGHT in pixels, such as 1280x720, got {size!r}")
    width, _, height = size.partition("x")
    return target(video, KINDS, VideoError, inputs, view.force), (int(width), int(height))
