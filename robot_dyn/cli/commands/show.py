"""Commands that show a robot or a run: show, replay, plot."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments
from robot_dyn.cli.application import LOOK, bar, command
from robot_dyn.cli.options import AS_STATED, Dark, Force, Name, PackageDir, Positions, RobotOptions
from robot_dyn.cli.terminal import say, say_written
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.files import target

if TYPE_CHECKING:
    from robot_dyn.view.live.server import Server

Html = Annotated[str | None, typer.Option(metavar="OUT.html", help="Write one file that needs no server, and end.")]
Video = Annotated[
    str | None,
    typer.Option(metavar="OUT.mp4", help="Write an .mp4 or .gif, drawn by an installed Chrome, Chromium or Edge."),
]
Inertia = Annotated[bool, typer.Option("--inertia", help="Draw each link's equivalent inertia box.")]
Meshes = Annotated[str, typer.Option(help="full, the triangles of their files, or coarse, for a smaller page.")]
Port = Annotated[int | None, typer.Option(min=1, max=65535, help="Where to listen; a free one by default.")]
Browse = Annotated[bool, typer.Option("--open", help="Open the page in your browser.")]


@command(LOOK, "show")
def show_(
    robot: Name,
    q: Positions = None,
    html: Html = None,
    inertia: Inertia = False,
    meshes: Meshes = "full",
    port: Port = None,
    browse: Browse = False,
    force: Force = False,
    options: RobotOptions = AS_STATED,
) -> None:
    """Show a robot in the browser, or as one HTML file.

    The browser has it live on this machine until Ctrl-C.
    """
    page = _page(html, port, [robot], force)
    loaded = options.load(robot)
    at = arguments.vector("--q", q, loaded.joint_names)
    look: Any = {"inertia": inertia, "meshes": meshes, "package_dirs": options.package_dir or ()}
    shown = rd.show(loaded, at, **look)
    if page is not None:
        with bar(what="writing the page"):
            file = shown.save(page)
        _written(file, browse)
    else:
        _serve(shown.serve(port), "robot", browse)


@command(LOOK)
def replay(
    runs: Annotated[
        list[str], typer.Argument(metavar="RUN.npz...", help="Run files; those after the first are drawn transparent.")
    ],
    html: Html = None,
    video: Video = None,
    fps: Annotated[
        int | None, typer.Option(help="Frames a second of the video: frame k shows t = k / fps; 60, or 25 of a .gif.")
    ] = None,
    size: Annotated[str, typer.Option(metavar="WIDTHxHEIGHT", help="Pixels of the video.")] = "1280x720",
    dark: Dark = False,
    frame: Annotated[
        str | None, typer.Option(metavar="LINK", help="Link whose path is drawn; the tip by default.")
    ] = None,
    inertia: Inertia = False,
    meshes: Meshes = "full",
    port: Port = None,
    browse: Browse = False,
    force: Force = False,
    package_dir: PackageDir = None,
) -> None:
    """Replay runs in the browser, or as one HTML file or a video.

    The browser has them live on this machine until Ctrl-C.
    """
    page = _page(html, port, runs, force)
    film = _film(video, html, port, runs, force, size)
    trajectories = [rd.load_run(path) for path in runs]
    options: Any = {"frame": frame, "inertia": inertia, "meshes": meshes, "package_dirs": package_dir or ()}
    if film is not None:
        path, pixels = film
        with bar(1.0, what="starting the browser", at_the_end="writing") as advance:
            shown = rd.replay(*trajectories, **options)
            file = shown.save_video(path, fps=fps, size=pixels, dark=dark, on_progress=advance)
        _written(file, browse)
    elif page is not None:
        with bar(what="writing the page"):
            file = rd.save_replay(trajectories[0], page, *trajectories[1:], **options)
        _written(file, browse)
    else:
        _serve(rd.replay(*trajectories, **options).serve(port), "run", browse)


@command(LOOK)
def plot(
    run: Annotated[str, typer.Argument(metavar="RUN.npz", help="A run file, as `robot-dyn simulate … -o` writes.")],
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="PLOT.png", help="A .png, .svg or .pdf; RUN.png by default.")
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="PART",
            help="overview, joints, torques, energy, tracking, phase or error_growth; may be repeated; by default the"
            " overview.",
        ),
    ] = None,
    joint: Annotated[list[str] | None, typer.Option(metavar="JOINT", help="Show this joint; may be repeated.")] = None,
    width_mm: Annotated[float, typer.Option("--width-mm", help="Width in mm; text keeps its size.")] = 180.0,
    paper: Annotated[bool, typer.Option("--paper", help="For a paper: thin lines, no title, legible in grey.")] = False,
    dark: Dark = False,
    force: Force = False,
) -> None:
    """Draw a run: joints, torques, energy, tracking, phase, error."""
    from robot_dyn.view.plots.plots import PICTURES, PlotError

    path = target(output or Path(run).with_suffix(".png"), PICTURES, PlotError, [run], force)
    look = {"theme": "dark" if dark else "light", "style": "paper" if paper else "screen", "width_mm": width_mm}
    with bar(what="drawing"):
        file = rd.save_plot(rd.load_run(run), path, only=only or (), joints=joint or None, **look)
    say(f"written: {file}")


def _page(html: str | None, port: int | None, inputs: list[str], force: bool) -> Path | None:
    """The file to write, checked; None if the page is served."""
    from robot_dyn.view.page import PAGE, ReplayError

    if html is not None and port is not None:
        raise QueryError("give --html or --port, not both: a file needs no server")
    return None if html is None else target(html, PAGE, ReplayError, inputs, force)


def _film(
    video: str | None, html: str | None, port: int | None, inputs: list[str], force: bool, size: str
) -> tuple[Path, tuple[int, int]] | None:
    """The video to write, checked, and its size in pixels; None if there is none."""
    from robot_dyn.foundations.errors import VideoError
    from robot_dyn.view.video.video import KINDS

    if video is None:
        return None
    if html is not None or port is not None:
        raise QueryError("give --video, --html or --port, not several")
    width, cross, height = size.partition("x")
    if not (cross and width.isascii() and width.isdecimal() and height.isascii() and height.isdecimal()):
        raise QueryError(f"--size must be WIDTHxHEIGHT in pixels, such as 1280x720, got {size!r}")
    return target(video, KINDS, VideoError, inputs, force), (int(width), int(height))


def _serve(server: Server, what: str, browse: bool) -> None:
    """Serve a page until Ctrl-C."""
    with server, suppress(KeyboardInterrupt):
        say(f"{server.url} shows the {what}; Ctrl-C ends it")
        _open(server.url, browse)
        server.wait()


def _written(file: Path, browse: bool) -> None:
    say_written(file)
    _open(file.absolute().as_uri(), browse)


def _open(address: str, browser: bool) -> None:
    if browser:
        import webbrowser

        webbrowser.open(address)
