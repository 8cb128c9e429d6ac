"""The bridge of a live page: drawing commands arrive by ZeroMQ, as meshcat programs send them, and go to browsers.

    request: command [path message]    answer: one frame, for any request, and without waiting for other clients

The scene is stored for browsers that connect later. [meshcat 0.3, servers/zmqserver.py]
"""

from __future__ import annotations

import asyncio
import json
from base64 import b64decode
from collections import deque
from collections.abc import Iterator
from typing import Protocol

import umsgpack
import zmq
import zmq.asyncio

from robot_dyn.foundations.errors import shorten
from robot_dyn.view.commands import Command, as_message

_ORDER = ("set_object", "set_property", "set_transform", "set_animation")  # in which a node is drawn
_PATIENCE_S = 30.0  # for a picture: a browser may be busy, hidden or gone
_MAX_MESSAGE = 2**28  # [bytes]


class _RequestError(Exception):
    """Internal: a request that has no answer; the message has the reason."""


class Browser(Protocol):
    """A connected browser."""

    def send(self, message: bytes) -> None:
        """Send a message."""
        ...

    def hang_up(self) -> None:
        """End the connection."""
        ...


class Scene:
    """The drawn scene as messages: for each node the last of each kind, and of each property."""

    def __init__(self) -> None:
        self._nodes: dict[tuple[str, ...], dict[tuple[int, str], bytes]] = {}

    def keep(self, command: Command, message: bytes) -> None:
        """Store a command and the message that carried it."""
        kind, path = command["type"], tuple(part for part in command["path"].split("/") if part)
        if kind == "delete":
            self._nodes = {place: node for place, node in self._nodes.items() if place[: len(path)] != path}
            return
        node = self._nodes.setdefault(path, {})
        if kind == "set_object":
            node.clear()
        node[_ORDER.index(kind), str(command.get("property", ""))] = message

    def messages(self) -> Iterator[bytes]:
        """Yield all messages, in the order of nodes; each node's object first."""
        for node in self._nodes.values():
            yield from (node[key] for key in sorted(node))


class Bridge:
    """Answers requests and passes drawings on, inside a running event loop.

    Attributes:
        url: Address at which requests arrive.
        scene: The drawn scene.
    """

    def __init__(self, commands: list[Command], web_url: str) -> None:
        self._web_url, self.scene = web_url, Scene()
        for command in commands:
            self.scene.keep(command, as_message(command))
        self._pictures: dict[Browser, deque[asyncio.Future[bytes]]] = {}  # requested from each browser
        self._watched = asyncio.Event()
        self._context = zmq.asyncio.Context()
        self._socket = self._context.socket(zmq.ROUTER)
        self._socket.setsockopt(zmq.MAXMSGSIZE, _MAX_MESSAGE)
        self._socket.bind("tcp://127.0.0.1:*")
        self.url = self._socket.getsockopt_string(zmq.LAST_ENDPOINT)

    async def serve(self) -> None:
        """Answer requests until cancelled, each in a separate task."""
        tasks: set[asyncio.Task[None]] = set()
        try:
            while True:
                task = asyncio.create_task(self._reply(await self._socket.recv_multipart()))
                tasks.add(task)
                task.add_done_callback(tasks.discard)
        finally:
            self._context.destroy(linger=0)

    @property
    def browsers(self) -> list[Browser]:
        """The connected browsers."""
        return list(self._pictures)

    def join(self, browser: Browser) -> None:
        """Send the scene, and later commands, to a browser."""
        for message in self.scene.messages():
            browser.send(message)
        self._pictures[browser] = deque()
        self._watched.set()

    def leave(self, browser: Browser) -> None:
        """Remove a browser."""
        self._pictures.pop(browser, None)
        if not self._pictures:
            self._watched.clear()

    def answered(self, browser: Browser, message: str | bytes) -> None:
        """Handle a message of a browser: the picture that was requested from it; other messages are ignored."""
        try:
            picture = b64decode(json.loads(message)["data"].partition(",")[2], validate=True)
        except (ValueError, TypeError, LookupError, AttributeError, RecursionError):
            return
        if (requests := self._pictures.get(browser)) and not (request := requests.popleft()).done():
            request.set_result(picture)

    async def _reply(self, frames: list[bytes]) -> None:
        envelope = 2 if frames[1:2] == [b""] else 1  # the address of the client
        try:
            answer = await self._answer(*frames[envelope:])
        except _RequestError as error:
            answer = f"error: {error}".encode()
        await self._socket.send_multipart([*frames[:envelope], answer])

    async def _answer(self, name: bytes = b"", *frames: bytes) -> bytes:
        match name.decode(errors="replace"):
            case "url":
                return self._web_url.encode()
            case "wait":
                await self._watched.wait()
                return b"ok"
            case "capture_image":
                return await self._picture()
            case ("set_object" | "set_property" | "set_transform" | "set_animation" | "delete") as kind:
                self._draw(kind, frames)
                return b"ok"
            case other:
                raise _RequestError(f"{shorten(other)!r} is not answered here; {', '.join(_ORDER)} and delete draw")

    def _draw(self, kind: str, frames: tuple[bytes, ...]) -> None:
        if len(frames) != 2:
            raise _RequestError(f"{kind} takes a path and a message, got {len(frames)} frames")
        try:
            command = umsgpack.unpackb(frames[1])
        except Exception as error:  # from any content of the message
            raise _RequestError(f"{kind}: the message is not MessagePack ({type(error).__name__})") from None
        if not isinstance(command, dict) or command.get("type") != kind or not isinstance(command.get("path"), str):
            raise _RequestError(f"the message must have the type {kind!r} and a path that is text")
        for browser in self.browsers:
            browser.send(frames[1])
        self.scene.keep(command, frames[1])

    async def _picture(self) -> bytes:
        """Return the picture of the first browser that answers, as a PNG file."""
        request: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        message = as_message({"type": "capture_image"})
        try:
            async with asyncio.timeout(_PATIENCE_S):
                await self._watched.wait()
                for browser, requests in list(self._pictures.items()):
                    requests.append(request)
                    browser.send(message)
                return await request
        except TimeoutError:
            raise _RequestError(f"no browser sent a picture within {_PATIENCE_S:g} s; open {self._web_url}") from None
