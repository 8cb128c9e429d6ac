"""The live server: the page, on 127.0.0.1 only, and the bridge by which meshcat programs draw into it.

Other programs may draw into the scene, by `meshcat.Visualizer(zmq_url)`.
"""

from __future__ import annotations

import asyncio
import logging
import os
import threading
from contextlib import suppress
from socket import create_server, socket
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.view.commands import Command
from robot_dyn.view.live.bridge import Bridge

_HOST = "127.0.0.1"
_MAX_PICTURE = 2**26  # [bytes], of a message from a browser
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'",  # the page's own policy stands in the page
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class ServerError(RobotDynError):
    """A live server that cannot start."""


class _Local(RequestHandler):
    """Refuses requests under foreign host names: a web site must not read a run."""

    def prepare(self) -> None:
        if self.request.host_name not in (_HOST, "localhost"):
            raise HTTPError(403)


class _Page(_Local):
    """The page."""

    def initialize(self, page: str) -> None:
        self._page = page

    def get(self) -> None:
        for name, value in _HEADERS.items():
            self.set_header(name, value)
        self.finish(self._page)


class Browser(_Local, WebSocketHandler):
    """The web socket of a browser; a request for a page here is redirected to it."""

    def initialize(self, bridge: Bridge) -> None:
        """Set the bridge that all browsers share."""
        self._bridge = bridge

    async def get(self, *args: Any, **kwargs: Any) -> None:
        """Open the web socket, or redirect to the page."""
        if self.request.headers.get("Upgrade", "").lower() == "websocket":
            await super().get(*args, **kwargs)
        else:
            self.redirect("/static/")

    def open(self, *_: str, **__: str) -> None:
        """Join the bridge."""
        self._bridge.join(self)

    def hang_up(self) -> None:
        """End the connection without waiting for the other end."""
        if self.ws_connection is not None:
            self.ws_connection.stream.close()  # pyright: ignore[reportOptionalMemberAccess]

    def on_close(self) -> None:
        self._bridge.leave(self)

    def on_message(self, message: str | bytes) -> None:
        self._bridge.answered(self, message)

    def send(self, message: bytes) -> None:
        """Send a message; a browser that has left is ignored."""
        with suppress(WebSocketClosedError):
            sent = self.write_message(message, binary=True)
            sent.add_done_callback(lambda done: done.cancelled() or done.exception())


class Server:
    """A live replay; it ends with `close`, or with the program.

    Attributes:
        url: Address of the page.
        zmq_url: Address for the requests of meshcat programs.
    """

    def __init__(self, page: str, commands: list[Command], port: int | None = None) -> None:
        """Serve in a separate thread.

        Raises:
            ServerError: If the port is taken.
        """
        try:
            listening = create_server((_HOST, port or 0))
        except (OSError, OverflowError) as error:
            why = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else error
            raise ServerError(f"port {port}: {why}; choose another, or none for a free one") from None
        listening.setblocking(False)
        logging.getLogger("tornado").addHandler(logging.NullHandler())  # not on the user's terminal
        self.url = f"http://{_HOST}:{listening.getsockname()[1]}/static/"
        self._ready, self._failure = threading.Event(), None
        serving = self._serve(page, commands, listening)
        self._thread = threading.Thread(target=asyncio.run, args=(serving,), daemon=True)
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            raise ServerError(f"the live replay cannot start: {self._failure}; write a file with .save(path) instead")

    async def _serve(self, page: str, commands: list[Command], listening: socket) -> None:
        self._loop, self._closed = asyncio.get_running_loop(), asyncio.Event()
        self._loop.set_exception_handler(lambda *_: None)  # ignore errors of the other end of a socket
        try:
            bridge = Bridge(commands, self.url)
            self.zmq_url = bridge.url
            handlers: list[Any] = [(r"/static/", _Page, {"page": page}), (r"/", Browser, {"bridge": bridge})]
            quiet: Any = {"log_function": lambda _: None, "websocket_max_message_size": _MAX_PICTURE}
            server = HTTPServer(Application(handlers, **quiet), max_body_size=0)
            server.add_sockets([listening])
        except Exception as error:  # reported to the waiting caller
            self._failure = error
            listening.close()
            return
        finally:
            self._ready.set()
        answering = asyncio.create_task(bridge.serve())
        await self._closed.wait()
        server.stop()
        await server.close_all_connections()
        for browser in bridge.browsers:
            browser.hang_up()
        answering.cancel()
        with suppress(asyncio.CancelledError):
            await answering

    def close(self) -> None:
        """End the server."""
        if self._thread.is_alive():
            with suppress(RuntimeError):  # it ends at this moment
                self._loop.call_soon_threadsafe(self._closed.set)
            self._thread.join()

    def wait(self) -> None:
        """Serve until interrupted (Ctrl-C), then end."""
        try:
            while self._thread.is_alive():
                self._thread.join(0.2)
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
