"""The live replay: on this machine alone, on a free port, gone with its command."""

from __future__ import annotations

import json
import os
import signal
import socket
import urllib.error
import urllib.request
from urllib.parse import urlparse

import numpy as np
import pytest

import robot_dyn as rd
from tests.browser import opened, until
from tests.command import run, started


@pytest.fixture(scope="module")
def swing():
    return rd.simulate(rd.load("planar_2r"), q0=[0.4, -0.7], duration_s=0.4, estimate_error=False)


def refused(host: str, port: int) -> bool:
    """Whether nobody listens there."""
    with socket.socket() as probe:
        probe.settimeout(2)
        return probe.connect_ex((host, port)) != 0


def test_the_live_page_shows_the_run_in_a_browser(browser, swing) -> None:
    """The scene comes over meshcat's socket; links stand where Pinocchio puts them, within single precision."""
    arm = rd.load("planar_2r")
    first, second = arm.joint_names
    with rd.replay(swing).serve() as server, opened(browser, server.url) as view:
        assert view.complaints == []
        view.ask(f"(replay.seek({np.float32(swing.t[-1])}), 0)")
        link = arm.description.element.xpath(f"joint[@name='{second}']/child/@link")[0]
        seen = view.placement(f"run/0 {first}/1 {second}/link {link}")
        np.testing.assert_allclose(seen, arm.placement(swing.q[-1], link), atol=2e-6)
        assert all(urlparse(url).hostname in ("127.0.0.1", None, "") for url in view.requests)


def test_another_meshcat_program_can_draw_into_it(browser, swing) -> None:
    zmq = pytest.importorskip("zmq")
    import umsgpack

    with rd.replay(swing).serve() as server, opened(browser, server.url) as view:
        client = zmq.Context.instance().socket(zmq.REQ)
        client.connect(server.zmq_url)
        command = {"type": "set_property", "path": "/guest", "property": "visible", "value": False}
        client.send_multipart([b"set_property", b"/guest", umsgpack.packb(command)])
        assert client.recv() == b"ok"
        client.close(linger=0)
        until(lambda: view.ask("viewer.scene_tree.children.guest?.object.visible === false"), "not drawn", view)


def test_nobody_else_is_served(swing) -> None:
    """It listens on the loopback address, not on this machine's others, and ends when it is closed."""
    with rd.replay(swing).serve() as server:
        port = urlparse(server.url).port
        assert urllib.request.urlopen(server.url, timeout=10).status == 200
        others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} | {"127.0.0.2"}
        assert all(refused(str(host), port) for host in others - {"127.0.0.1"})
    assert refused("127.0.0.1", port)


@pytest.mark.parametrize("path", ["static/", ""])
def test_a_foreign_name_is_refused(swing, path: str) -> None:
    """A web site whose name was turned to this machine's address can read nothing: 403, for page and socket."""
    with rd.replay(swing).serve() as server:
        request = urllib.request.Request(server.url.replace("static/", path), headers={"Host": "evil.example"})
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(request, timeout=10)


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


def test_two_replays_stand_side_by_side(swing) -> None:
    with rd.replay(swing).serve() as one, rd.replay(swing).serve() as two:
        assert one.url != two.url
        assert all(urllib.request.urlopen(each.url, timeout=10).status == 200 for each in (one, two))


@pytest.mark.skipif(os.name == "nt", reason="SIGINT")
def test_the_command_serves_until_interrupted(swing, tmp_path) -> None:
    """It says where, serves, and Ctrl-C ends it with exit code 0, a free port and nothing on stderr."""
    file = rd.save_run(swing, tmp_path / "run.npz")
    with started("replay", file) as command:
        assert command.stdout is not None
        url = command.stdout.readline().split()[0]
        assert b"meshcat" in urllib.request.urlopen(url, timeout=10).read().lower()
        command.send_signal(signal.SIGINT)
        _, errors = command.communicate(timeout=20)
    assert (command.returncode, errors) == (0, "")
    assert refused("127.0.0.1", urlparse(url).port)


def test_bad_input_is_told_in_one_line(swing, tmp_path) -> None:
    file = rd.save_run(swing, tmp_path / "run.npz")
    half = tmp_path / "half.npz"
    half.write_bytes(file.read_bytes()[:2000])
    cases = {
        (str(half),): "cannot be read as a run file",
        (str(tmp_path / "none.npz"),): "there is no such file",
        (str(file), "--html", str(tmp_path / "no" / "out.html")): "there is no folder",
        (str(file), "--html", str(tmp_path)): "is a folder",
        (str(file), "--html", str(tmp_path / "a.html"), "--frame", "hnd"): "no link 'hnd'",
        (str(file), "--html", "a.html", "--port", "8000"): "not both",
    }
    for args, text in cases.items():
        done = run("replay", *args)
        assert done.returncode == 2, args
        assert text in done.stderr and done.stderr.count("\n") == 1, done.stderr


def test_runs_that_cannot_be_shown_say_why(swing, tmp_path) -> None:
    from dataclasses import replace

    empty = replace(swing, **{name: getattr(swing, name)[:0] for name in ("t", "q", "v", "a", "u")})
    with pytest.raises(rd.RobotDynError, match="no samples"):
        rd.save_replay(empty, tmp_path / "empty.html")
    with pytest.raises(rd.RobotDynError, match="carries no URDF"):
        rd.save_replay(replace(swing, about={}), tmp_path / "none.html")
    with pytest.raises(rd.RobotDynError, match="not those of its URDF"):
        rd.save_replay(replace(swing, joint_names=("a", "b")), tmp_path / "other.html")
    broken = swing.about | {"edits": json.dumps({"gravity": 1})}
    with pytest.raises(rd.RobotDynError, match="edits that the run carries"):
        rd.save_replay(replace(swing, about=broken), tmp_path / "broken.html")


def test_a_diverged_run_is_shown_as_far_as_it_is_finite(browser, tmp_path) -> None:
    """The samples beyond are counted on the page."""
    from dataclasses import replace

    swing = rd.simulate(rd.load("planar_2r"), q0=[0.4, -0.7], duration_s=0.4, integrator="rk4", estimate_error=False)
    q = swing.q.copy()
    q[300:] = np.nan
    with pytest.warns(rd.ModelWarning, match="the last 101 samples are not shown"):
        page = rd.save_replay(replace(swing, q=q), tmp_path / "bad.html")
    with opened(browser, page) as view:
        assert "the last 101 samples are not shown" in view.ask("document.querySelector('header').textContent")
        assert view.ask("replay.duration") == pytest.approx(0.299)
        assert view.complaints == []
