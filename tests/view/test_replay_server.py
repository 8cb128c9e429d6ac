"""The live page: on this machine alone, on a free port, gone with its command.

Under any message each request has its answer, nobody waits for another, and nothing reaches stderr.
"""

from __future__ import annotations

import asyncio
import io
import os
import signal
import socket
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from urllib.parse import urlparse

import numpy as np
import pytest
import umsgpack
import zmq

import robot_dyn as rd
from robot_dyn.view.live.bridge import Scene
from tests.browser import opened, until
from tests.command import started

JUNK = [
    [b""], [b"capture"], [b"\xff\xfe\x00"], [b"set_object"], [b"set_object", b"/x"],
    [b"set_object", b"\xff", b"no MessagePack"], [b"set_object", b"/x", b""],
    [b"set_object", b"/x", umsgpack.packb([1, 2])],
    [b"set_object", b"/x", umsgpack.packb({"type": "delete", "path": "/x"})],
    [b"set_transform", b"/x", umsgpack.packb({"type": "set_transform", "path": 3})],
    [b"set_property", b"/x", b"\x91" * 5000],  # arrays in arrays
    [b"delete", b"/x", b"\xc1"], [b"get_scene"],
    [b"x" * 100_000, b"y"],
]  # fmt: skip
TEXTS = ["", "{", '{"data": 1}', '{"data": null}', '{"data": "no comma"}', '{"data": "a,!"}', "[]", "3", "[" * 50_000]


@pytest.fixture(scope="module")
def swing():
    return rd.simulate(rd.load("planar_2r"), q0=[0.4, -0.7], duration_s=0.1, estimate_error=False)


@pytest.fixture
def server(swing):
    with rd.replay(swing).serve() as serving:
        yield serving


def refused(host: str, port: int) -> bool:
    """Whether nobody listens there."""
    with socket.socket() as probe:
        probe.settimeout(2)
        return probe.connect_ex((host, port)) != 0


class Client:
    """A meshcat program: asks, and gives up after a while."""

    def __init__(self, url: str, patience_ms: int = 20_000) -> None:
        self.socket = zmq.Context.instance().socket(zmq.REQ)
        self.socket.setsockopt(zmq.RCVTIMEO, patience_ms)
        self.socket.connect(url)

    def ask(self, *frames: bytes) -> bytes:
        self.socket.send_multipart(frames)
        return self.socket.recv()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close(linger=0)


def junk_over_the_socket(url: str) -> None:
    """A browser that sends anything."""
    from tornado.websocket import websocket_connect

    async def send() -> None:
        connection = await websocket_connect(url.replace("http", "ws").replace("/static", ""))
        for text in TEXTS:
            await connection.write_message(text)
        await connection.write_message(b"\xff\x00", binary=True)
        connection.close()
        while await connection.read_message() is not None:  # until the other end has closed it, too
            pass

    with ThreadPoolExecutor(1) as other:  # this thread's loop is the browser's
        other.submit(asyncio.run, send()).result(timeout=30)


def test_every_request_is_answered_whatever_it_holds(server) -> None:
    with Client(server.zmq_url) as client:
        for frames in JUNK:
            assert client.ask(*frames).startswith(b"error: "), frames
        assert client.ask(b"url").decode() == server.url
        assert client.ask(b"delete", b"/x", umsgpack.packb({"type": "delete", "path": "/x"})) == b"ok"


def test_who_waits_for_a_browser_holds_up_nobody(server) -> None:
    with Client(server.zmq_url) as one, Client(server.zmq_url) as two:
        one.socket.send(b"wait")
        two.socket.send_multipart([b"capture_image"])
        with Client(server.zmq_url) as three:
            assert three.ask(b"url").decode() == server.url


def test_a_picture_without_a_browser_is_refused_in_the_end(server, monkeypatch) -> None:
    monkeypatch.setattr("robot_dyn.view.live.bridge._PATIENCE_S", 0.2)
    with Client(server.zmq_url) as client:
        assert client.ask(b"capture_image").startswith(b"error: no browser sent a picture within 0.2 s; open http")
        assert client.ask(b"url").decode() == server.url


def test_a_picture_is_what_the_browser_shows_and_the_next_request_is_answered(browser, server) -> None:
    """Once with the frames of meshcat's client, once with the name alone; beside it a browser that sends junk."""
    from PIL import Image

    with opened(browser, server.url) as view, Client(server.zmq_url) as client:
        assert client.ask(b"wait") == b"ok"
        junk_over_the_socket(server.url)
        for frames in ([b"capture_image", b"", umsgpack.packb({"type": "capture_image"})], [b"capture_image"]):

            def agrees(frames: list[bytes] = frames) -> bool:  # once the scene stands
                client.socket.send_multipart(frames)
                until(lambda: view.ask("true") and client.socket.poll(0), "no picture", view)
                seen = np.asarray(Image.open(io.BytesIO(client.socket.recv())).convert("RGB")).astype(int)
                shown = view.picture()
                return seen.shape == shown.shape and (np.abs(seen - shown).sum(axis=2) > 30).mean() < 1e-3

            until(agrees, "another picture", view)
        assert client.ask(b"url").decode() == server.url


def test_the_live_page_shows_the_run_and_what_other_meshcat_programs_draw(browser, server, swing) -> None:
    """The scene comes over meshcat's socket; links stand where Pinocchio puts them, within single precision."""
    with opened(browser, server.url) as view, Client(server.zmq_url) as client:
        view.ask(f"(replay.seek({np.float32(swing.t[-1])}), 0)")
        view.stands(rd.load("planar_2r"), swing.q[-1], "tip")
        command = {"type": "set_property", "path": "/guest", "property": "visible", "value": False}
        assert client.ask(b"set_property", b"/guest", umsgpack.packb(command)) == b"ok"
        until(lambda: view.ask("viewer.scene_tree.children.guest?.object.visible === false"), "not drawn", view)


@pytest.mark.parametrize(
    ("path", "name", "data", "status"),
    [
        ("none", "", None, 404),
        ("static/../../etc/passwd", "", None, 404),
        ("static", "", None, 404),
        ("", "", b"", 405),
        ("static/", "evil.example", None, 403),  # a web site whose name was turned to this machine's address
        ("", "evil.example", None, 403),
    ],
)
def test_the_root_leads_to_the_page_and_nothing_else_is_there(
    server, path: str, name: str, data: Any, status: int
) -> None:
    root = server.url.removesuffix("static/")
    with urllib.request.urlopen(root, timeout=10) as page:
        assert (page.status, page.url) == (200, server.url)
        assert page.headers["X-Content-Type-Options"] == "nosniff"
    request = urllib.request.Request(root + path, data=data, headers={"Host": name} if name else {})
    with pytest.raises(urllib.error.HTTPError, match=str(status)):
        urllib.request.urlopen(request, timeout=10)


def test_nobody_else_is_served(swing) -> None:
    """Two listen on the loopback address, not on this machine's others, and end when they are closed."""
    with rd.replay(swing).serve() as one, rd.replay(swing).serve() as two:
        others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} | {"127.0.0.2"}
        ports = [urlparse(each.url).port or 0 for each in (one, two)]
        assert ports[0] != ports[1]
        for each, port in zip((one, two), ports, strict=True):
            assert urllib.request.urlopen(each.url, timeout=10).status == 200
            assert all(refused(str(host), port) for host in others - {"127.0.0.1"})
    assert all(refused("127.0.0.1", port) for port in ports)


def test_a_port_in_use_is_told_with_the_remedy(swing) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(rd.RobotDynError, match=rf"port {port}: .*in use; choose another"):
            rd.replay(swing).serve(port)


def test_a_bridge_that_cannot_start_is_told_and_does_not_hang(swing, monkeypatch) -> None:
    from robot_dyn.view.live import server

    def refuse(*_: object) -> None:
        raise OSError("no sockets left")

    monkeypatch.setattr(server, "Bridge", refuse)
    with pytest.raises(rd.RobotDynError, match=r"cannot start: no sockets left; write a file"):
        rd.replay(swing).serve()


@pytest.mark.skipif(os.name == "nt", reason="SIGINT")
def test_nothing_reaches_the_terminal_of_the_command_and_ctrl_c_ends_it(swing, tmp_path) -> None:
    """With junk and raw bytes: its stderr stays empty, its exit code is 0, and its port is free again."""
    file = swing.save(tmp_path / "run.npz")
    heads = (b"GET / HTTP/1.1\r\nHost: x\r\n\r\n", b"\x00\xff\r\n\r\n", b"POST /static/ HTTP/9\r\n\r\n", b"GET")
    with started("replay", file) as command:
        assert command.stdout is not None
        url = command.stdout.readline().split()[0]
        port = urlparse(url).port or 0
        junk_over_the_socket(url)
        for head in heads:
            with socket.create_connection(("127.0.0.1", port), timeout=10) as raw:
                raw.sendall(head)
                raw.shutdown(socket.SHUT_WR)
                raw.recv(100)
        assert b"meshcat" in urllib.request.urlopen(url, timeout=10).read().lower()
        command.send_signal(signal.SIGINT)
        _, errors = command.communicate(timeout=20)
    assert (command.returncode, errors) == (0, "")
    assert refused("127.0.0.1", port)


def test_a_scene_keeps_the_last_of_each_and_forgets_what_is_deleted() -> None:
    """As a browser that watched from the beginning has it; a thousand values of a property are one."""
    scene = Scene()
    scene.keep({"type": "set_transform", "path": "/a"}, b"T")
    scene.keep({"type": "set_object", "path": "a"}, b"O")
    for number in range(1000):
        scene.keep({"type": "set_property", "path": "a/", "property": "visible"}, b"P%d" % number)
    scene.keep({"type": "set_object", "path": "/a/b"}, b"B")
    scene.keep({"type": "set_object", "path": "/ab"}, b"AB")
    scene.keep({"type": "set_transform", "path": "/a"}, b"T2")
    assert list(scene.messages()) == [b"O", b"P999", b"T2", b"B", b"AB"]
    scene.keep({"type": "delete", "path": "/a"}, b"")
    assert list(scene.messages()) == [b"AB"]


def inserted(view) -> list[bool]:
    """Whether a script, and a handler in an attribute, run once they got into the page."""
    view.ask("""(() => {
      document.body.append(Object.assign(document.createElement("script"), { textContent: "window.ran = true" }));
      document.body.insertAdjacentHTML("beforeend", "<img src='data:,' onerror='window.handled = true'>");
      document.body.insertAdjacentHTML("beforeend", "<b id='styled' style='color: rgb(1, 2, 3)'>x</b>");
    })()""")
    view.page.wait_for_timeout(200)
    styled = "getComputedStyle(document.getElementById('styled')).color == 'rgb(1, 2, 3)'"
    return [view.ask("!!window.ran"), view.ask("!!window.handled"), view.ask(styled)]


@pytest.mark.parametrize("live", [False, True])
def test_only_the_pages_own_scripts_and_styles_run(browser, swing, server, live: bool) -> None:
    """The content policy names them by hash; the panel of meshcat keeps its look: its folders stand at the right."""
    with opened(browser, server.url if live else rd.replay(swing), complains=True) as view:
        assert view.complaints == []
        assert view.ask("getComputedStyle(document.querySelector('.dg.main .close-button')).cursor") == "pointer"
        policy = view.ask("document.querySelector('meta[http-equiv]').content")
        assert "unsafe" not in policy and "*" not in policy.split("connect-src")[0]
        assert inserted(view) == [False, False, False]
        assert len(view.complaints) >= 3 and all("Content Security Policy" in each for each in view.complaints)
