"""The served page: on this machine alone, on a free port, gone with its command; nothing reaches stderr."""

from __future__ import annotations

import os
import signal
import socket
import urllib.error
import urllib.request
from typing import Any
from urllib.parse import urlparse

import numpy as np
import pytest

import robot_dyn as rd
from tests.browser import opened
from tests.command import started


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


def test_the_served_page_shows_the_run(browser, server, swing) -> None:
    """Links stand where Pinocchio puts them, within single precision."""
    with opened(browser, server.url) as view:
        view.ask(f"(replay.seek({np.float32(swing.t[-1])}), 0)")
        view.stands(rd.load("planar_2r"), swing.q[-1], "tip")


@pytest.mark.parametrize(
    ("path", "name", "data", "status"),
    [
        ("none", "", None, 404),
        ("static/../../etc/passwd", "", None, 404),
        ("", "", b"", 501),
        ("", "evil.example", None, 403),  # a web site whose name was turned to this machine's address
        ("", "[::1", None, 403),
    ],
)
def test_only_the_page_is_served(server, path: str, name: str, data: Any, status: int) -> None:
    with urllib.request.urlopen(server.url, timeout=10) as page:
        assert (page.status, page.headers["X-Content-Type-Options"]) == (200, "nosniff")
    request = urllib.request.Request(server.url + path, data=data, headers={"Host": name} if name else {})
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


@pytest.mark.skipif(os.name == "nt", reason="SIGINT")
def test_nothing_reaches_the_terminal_of_the_command_and_ctrl_c_ends_it(swing, tmp_path) -> None:
    """With raw bytes: its stderr stays empty, its exit code is 0, and its port is free again."""
    file = swing.save(tmp_path / "run.npz")
    heads = (b"GET / HTTP/1.1\r\nHost: x\r\n\r\n", b"\x00\xff\r\n\r\n", b"POST / HTTP/9\r\n\r\n", b"GET")
    with started("replay", file) as command:
        assert command.stdout is not None
        url = command.stdout.readline().split()[0]
        port = urlparse(url).port or 0
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


@pytest.mark.parametrize("is_served", [False, True])
def test_only_the_pages_own_scripts_and_styles_run(browser, swing, server, is_served: bool) -> None:
    """The content policy names them by hash; the panel of meshcat keeps its look: its folders stand at the right."""
    with opened(browser, server.url if is_served else rd.replay(swing), complains=True) as view:
        assert view.complaints == []
        assert view.ask("getComputedStyle(document.querySelector('.dg.main .close-button')).cursor") == "pointer"
        policy = view.ask("document.querySelector('meta[http-equiv]').content")
        assert "unsafe" not in policy and "*" not in policy
        assert inserted(view) == [False, False, False]
        assert len(view.complaints) >= 3 and all("Content Security Policy" in each for each in view.complaints)
