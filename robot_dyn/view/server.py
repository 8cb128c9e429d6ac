"""The live server: meshcat's bridge on 127.0.0.1 alone, with the replay's page in place of meshcat's.

Other meshcat programs may draw into the scene, by `meshcat.Visualizer(zmq_url)`.
"""

from __future__ import annotations

import asyncio
import json
import os
import threading
import warnings
from contextlib import suppress
from socket import create_server, socket
from typing import Any

import zmq
from tornado.httpserver import HTTPServer
from tornado.web import Application, HTTPError, RequestHandler

from robot_dyn.errors import RobotDynError
from robot_dyn.view.commands import Command, as_message

with warnings.catch_warnings(action="ignore", category=DeprecationWarning):  # meshcat imports a module zmq gave up
    from meshcat.servers.tree import find_node
    from meshcat.servers.zmqserver import WebSocketHandler, ZMQWebSocketBridge

_HOST = "127.0.0.1"


class ServerError(RobotDynError):
    """A live server that cannot start."""


class _Loopback(Application):
    """An application that listens on the socket it is given, whatever it is asked."""

    def __init__(self, listening: socket, handlers: list[Any]) -> None:
        super().__init__(handlers)
        self._listening = listening

    def listen(self, port: int, *_: Any, **__: Any) -> HTTPServer:
        server = HTTPServer(self)
        server.add_sockets([self._listening])
        return server


class _Local(RequestHandler):
    """Asked for by another name than this machine's own, it refuses: a web site must not read a run."""

    def prepare(self) -> None:
        if self.request.host_name not in (_HOST, "localhost"):
            raise HTTPError(403)


class _Page(_Local):
    """The page."""

    def initialize(self, page: str) -> None:
        self._page = page

    def get(self) -> None:
        self.set_header("Cache-Control", "no-store")
        self.finish(self._page)


class _Socket(_Local, WebSocketHandler):
    """meshcat's web socket, silent."""

    def open(self, *_: str, **__: str) -> None:
        self.bridge.websocket_pool.add(self)
        self.bridge.send_scene(self)

    def on_close(self) -> None:
        self.bridge.websocket_pool.discard(self)

    def on_message(self, message: str | bytes) -> None:
        with suppress(ValueError, KeyError, TypeError):  # what is no picture that was asked for
            self.bridge.send_image(json.loads(message)["data"])


class _Bridge(ZMQWebSocketBridge):
    """meshcat's bridge, which would listen on every interface, on a socket of this machine alone."""

    def __init__(self, page: str, listening: socket) -> None:
        self._page, self._listening = page, listening
        super().__init__(zmq_url=f"tcp://{_HOST}:*", host=_HOST, port=listening.getsockname()[1])
        self.zmq_url = self.zmq_socket.getsockopt_string(zmq.LAST_ENDPOINT)

    def make_app(self) -> Application:
        page = {"page": self._page}
        handlers = [(r"/static/", _Page, page), (r"/", _Socket, {"bridge": self})]
        return _Loopback(self._listening, handlers)


class Server:
    """A live replay; `close` ends it, and so does the end of the program.

    Attributes:
        url: Where to look.
        zmq_url: Where meshcat programs may draw.
    """

    def __init__(self, page: str, commands: list[Command], port: int | None = None) -> None:
        """Serve in a thread of its own.

        Raises:
            ServerError: If the port is taken.
        """
        try:
            listening = create_server((_HOST, port or 0))
        except (OSError, OverflowError) as error:
            why = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else error
            raise ServerError(f"port {port}: {why}; choose another, or none for a free one") from None
        listening.setblocking(False)
        ready, self._failure = threading.Event(), None
        self._thread = threading.Thread(target=self._serve, args=(page, commands, listening, ready), daemon=True)
        self._thread.start()
        ready.wait()
        if self._failure is not None:
            raise ServerError(f"the live replay cannot start: {self._failure}; write a file with save_replay instead")

    def _serve(self, page: str, commands: list[Command], listening: socket, ready: threading.Event) -> None:
        self._loop = asyncio.new_event_loop()
        asyncio.set_event_loop(self._loop)
        try:
            bridge = _Bridge(page, listening)
        except Exception as error:  # of sockets, or of meshcat: for the caller, who waits
            self._failure = error
            listening.close()
            self._loop.close()
            ready.set()
            return
        for command in commands:
            _keep(bridge, command)
        self.url, self.zmq_url = str(bridge.web_url), bridge.zmq_url
        ready.set()
        try:
            self._loop.run_forever()
        finally:
            bridge.zmq_stream.close()
            listening.close()
            self._loop.close()

    def close(self) -> None:
        """End the server."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()

    def wait(self, interrupted: threading.Event | None = None) -> None:
        """Serve until interrupted (Ctrl-C), or until `interrupted` is set, then end."""
        try:
            while self._thread.is_alive() and not (interrupted and interrupted.is_set()):
                self._thread.join(0.2)
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _keep(bridge: _Bridge, command: Command) -> None:
    """Put a command into the bridge's tree, from which each browser that comes is served."""
    node = find_node(bridge.tree, [part for part in command["path"].split("/") if part])
    message = as_message(command)
    match command["type"]:
        case "set_object":
            node.object = message
        case "set_transform":
            node.transform = message
        case "set_property":
            node.properties.append(message)
        case "set_animation":
            node.animation = message  # pyright: ignore[reportAttributeAccessIssue]
