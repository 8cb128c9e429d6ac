"""Pages in the cells of a notebook, in a real browser: as nbconvert writes them, offline, and where frames are removed.

Outside a notebook: an address, and no server.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import io
import json
import re
import subprocess
import sys
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from tests.browser import View, opened, until
from tests.long import long

CELLS = (
    "import robot_dyn as rd; arm = rd.load('planar_2r')",
    "rd.show(arm, [0.4, -0.7])",
    "rd.replay(rd.simulate(arm, [0.4, -0.7], duration_s=0.4, estimate_error=False))",
)


@pytest.fixture(scope="module")
def swing():
    return rd.simulate(rd.load("planar_2r"), [0.4, -0.7], duration_s=0.4, estimate_error=False)


@pytest.fixture(scope="module")
def notebook():
    """A notebook with both cells, executed."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in CELLS])
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    book.metadata["kernelspec"] = kernel
    nbclient.NotebookClient(book, timeout=120).execute()
    return book


@pytest.fixture(scope="module")
def exported(notebook, tmp_path_factory) -> Path:
    """It as HTML, by nbconvert."""
    nbconvert = pytest.importorskip("nbconvert")
    file = tmp_path_factory.mktemp("cells") / "book.html"
    exporter = nbconvert.HTMLExporter(require_js_url="", mathjax_url="", jquery_url="", mermaid_js_url="")
    file.write_text(exporter.from_notebook_node(notebook)[0], encoding="utf-8")
    return file


def framed(browser: Any, file: Path, count: int, scheme: Any = "light") -> tuple[View, list[View]]:
    """A host page, and the pages in its frames once each is drawn, with the network off."""
    context = browser.new_context(viewport={"width": 1000, "height": 1400}, offline=True, color_scheme=scheme)
    host = View(context.new_page())
    host.page.on("console", lambda m: host.complaints.append(m.text) if m.type == "error" else None)
    host.page.on("pageerror", lambda error: host.complaints.append(str(error)))
    host.page.on("request", lambda request: host.requests.append(request.url))
    host.page.goto(file.as_uri())
    until(lambda: len(host.page.query_selector_all("iframe")) == len(host.page.frames) - 1 == count, "no frames", host)
    frames = [View(frame) for frame in host.page.frames[1:]]
    for each in frames:
        until(lambda each=each: each.ask("!!(window.replay && viewer.animator.actions.length)"), "not drawn", host)
    return host, frames


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_both_cells_are_drawn_in_what_nbconvert_writes(browser, exported, scheme: str) -> None:
    """Links stand where Pinocchio puts them, in the page's colours; nothing is complained of or asked of a network.

    The origin of a frame is its own: it reaches neither the document around it nor what the browser stores there.
    """
    host, (still, run) = framed(browser, exported, 2, scheme)
    path = still.path("tip")
    run.ask("(replay.seek(0), 0)")
    for frame in (still, run):
        frame.stands(rd.load("planar_2r"), [0.4, -0.7], "tip")
    run.ask("(replay.seek(0.4), 0)")
    assert np.abs(run.placement(path) - still.placement(path)).max() > 0.01
    shown = run.picture()
    run.ask("(viewer.set_property(['run'], 'visible', false), 0)")
    assert (np.abs(shown - run.picture()).sum(axis=2) > 30).mean() > 0.005
    paper = run.ask("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, re.findall(r"\d+", paper))) < 300) is (scheme == "dark")
    for what in ("parent.document.title", "localStorage.x"):
        refused = f"(() => {{ try {{ return {what} }} catch (e) {{ return e.name }} }})()"
        assert [frame.ask(refused) for frame in (still, run)] == ["SecurityError"] * 2
    host.page.wait_for_timeout(500)  # longer than until a page writes its address, which a frame has not
    assert host.complaints == []
    assert all(url.startswith(("file:", "data:", "blob:", "about:")) for url in host.requests), host.requests
    host.page.context.close()


def test_the_outputs_carry_a_picture_and_a_line_without_a_path(notebook) -> None:
    """For places that remove frames: PNG, text; no place of this machine stands in the notebook."""
    from PIL import Image

    for cell, title in zip(
        notebook.cells[1:], ("planar_2r: 2 joints", "planar_2r: finished at t = 0.4 s"), strict=True
    ):
        *told, output = cell.outputs
        assert all(each.get("name") == "stderr" for each in told)  # that a slow machine compiles, say
        assert set(output.data) == {"text/html", "image/png", "text/plain"}
        assert Image.open(io.BytesIO(base64.b64decode(output.data["image/png"]))).size == (720, 480)
        assert output.data["text/plain"].startswith(f"<{title}")
        assert "/tmp" not in json.dumps(output.data) and "file:" not in output.data["text/plain"]


def test_without_its_frame_the_output_is_its_picture(browser, swing, tmp_path) -> None:
    """Sanitisers of HTML drop the frame and keep its content."""
    html = rd.replay(swing)._repr_mimebundle_()["text/html"]
    (tmp_path / "bare.html").write_text(re.sub(r"</?iframe[^>]*>", "", html))
    page = browser.new_page()
    page.goto((tmp_path / "bare.html").as_uri())
    assert page.evaluate("[document.images.length, document.images[0].naturalWidth]") == [1, 720]
    page.close()


def test_the_still_picture_is_what_the_page_shows(browser) -> None:
    """A dark arm on light paper: the silhouettes of the two renderers overlap by more than 90 %."""
    from PIL import Image

    page = rd.show(rd.load("ur5"), [0.3, -1.1, 0.9, -0.6, 1.2, 0.4])
    mine = silhouette(np.asarray(Image.open(io.BytesIO(base64.b64decode(page._repr_mimebundle_()["image/png"])))))
    with opened(browser, page, size=(720, 700)) as view:
        view.ask("(stage.style.height = '480px', 0)")
        until(lambda: view.ask("viewer.renderer.domElement.clientHeight") == 480, "not resized", view)
        theirs = silhouette(view.picture())
    assert mine.shape == theirs.shape
    assert (mine & theirs).sum() / (mine | theirs).sum() > 0.9


def silhouette(picture: np.ndarray) -> np.ndarray:
    """Where a picture is dark: the UR5, and neither the floor nor the sky."""
    return np.asarray(picture)[..., :3].astype(int).sum(axis=2) < 420


def parts(text: str) -> tuple[str, bytes]:
    """The content policy of a page, and the viewer's script in it, inflated."""
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    packed = re.search(r'id="meshcat">([^<]*)<', text)
    assert policy and packed
    return policy[1], gzip.decompress(base64.b64decode(packed[1]))


def test_the_policy_has_the_digest_of_the_script_and_no_word_that_allows_others(swing) -> None:
    """SHA-256 by hashlib, of the file of meshcat as it is."""
    import importlib.util

    spec = importlib.util.find_spec("meshcat")
    assert spec is not None and spec.submodule_search_locations
    file = Path(spec.submodule_search_locations[0]) / "viewer" / "dist" / "main.min.js"
    for text in (rd.replay(swing).text, rd.show(rd.load("planar_2r")).text):
        policy, script = parts(text)
        assert script == file.read_bytes()
        assert f"'sha256-{base64.b64encode(hashlib.sha256(script).digest()).decode()}'" in policy.split("style-src")[0]
        assert "unsafe" not in policy and "strict-dynamic" not in policy


@pytest.mark.parametrize("how", ["damaged", "exchanged"])
def test_a_script_that_is_not_the_viewers_does_not_run_and_the_page_says_so(browser, swing, tmp_path, how: str) -> None:
    text = rd.replay(swing).text
    packed = re.search(r'id="meshcat">([^<]*)<', text)
    assert packed
    evil = base64.b64encode(gzip.compress(b"window.MeshCat = {}; window.ran = true;")).decode()
    other = packed[1][:40_000] + "AAAA" + packed[1][40_004:] if how == "damaged" else evil
    (tmp_path / "page.html").write_text(text.replace(packed[1], other), encoding="utf-8")
    page = browser.new_page()
    page.goto((tmp_path / "page.html").as_uri())
    outcome = page.locator("#outcome")
    until(lambda: "cannot be shown" in (outcome.text_content() or ""), "the page says nothing")
    assert "as it was written" in (outcome.text_content() or "")
    assert page.evaluate("!!window.ran") is False
    page.close()


@pytest.mark.parametrize("name, most", [("ur5", 1.8e6), *long([("panda", 2.7e6)])])
def test_a_page_takes_no_more_than_promised(name: str, most: float) -> None:
    """In bytes, of an arm at rest and of two seconds of it, all triangles of its meshes included."""
    arm = rd.load(name)
    run = rd.simulate(arm, np.linspace(0.1, 0.5, arm.n), duration_s=2.0, estimate_error=False)
    for page in (rd.show(arm), rd.replay(run)):
        assert len(page.text.encode()) <= most


def test_ten_seconds_of_ur5_stay_under_fifteen_megabytes() -> None:
    arm, q = rd.load("ur5"), np.array([0.3, -1.1, 0.9, -0.6, 1.2, 0.4])
    plan = rd.control.via_points([0, 4, 7, 10], [q, q + 1, q - 0.5, q])
    kp, kd = rd.control.gains_from(1.0, bandwidth_rad_s=20.0)
    drive = rd.control.ComputedTorque(arm, plan, kp=kp, kd=kd)
    run = rd.simulate(arm, q, duration_s=10.0, controller=drive, method="RK4", estimate_error=False)
    assert len(run.t) == 10_001
    assert len(rd.replay(run).text.encode()) < 15e6


def test_a_page_is_its_document(swing) -> None:
    """Put together as the page's script does, to the last bit: of arrays the first bytes of all numbers come first."""
    page = rd.replay(swing)
    packed = re.search(r'id="data">"([^<]*)"<', page.text)
    assert packed
    content = gzip.decompress(base64.b64decode(packed[1]))
    begin = 8 + int.from_bytes(content[:8], "little")

    def numbers(found: dict[str, Any]) -> Any:
        if "$array" not in found:
            return found
        kind = np.dtype(found["$array"].removesuffix("Array").lower())
        stored = np.frombuffer(content, np.uint8, found["length"] * kind.itemsize, begin + found["offset"])
        return stored.reshape(kind.itemsize, -1).T.copy().view(kind).ravel().tolist()

    stated = json.dumps(json.loads(content[8:begin], object_hook=numbers))
    is_same = stated == json.dumps(dict(page.document), default=lambda array: array.ravel().tolist())
    assert is_same  # texts of megabytes, which are not to be told


def test_outside_a_notebook_an_address_is_printed_and_nothing_stays_open(tmp_path) -> None:
    """A script ends by itself; the page at the address is there, whole, and IPython was not loaded."""
    program = (
        "import sys, robot_dyn as rd; page = rd.show(rd.load('planar_2r')); print(page); page._repr_mimebundle_();"
        "print('IPython' in sys.modules, 'zmq' in sys.modules, 'tornado' in sys.modules, 'matplotlib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    line, loaded = done.stdout.splitlines()
    assert loaded == "False False False False"
    address = re.search(r"file://(\S+)>$", line)
    assert address
    file = Path(unescape(address[1]))
    assert file.read_bytes().startswith(b"<!DOCTYPE html>") and file.read_bytes().endswith(b"</html>\n")
    assert file.parent.stat().st_mode & 0o077 == 0  # of the user alone
    file.unlink()
    file.parent.rmdir()


def test_a_page_that_cannot_be_written_says_where_to(swing, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "none"))
    with pytest.raises(rd.RobotDynError, match=r"no temporary folder.*\.save\(path\)"):
        _ = rd.replay(swing).address


@pytest.mark.parametrize("port", [0, 70_000, "80", *long([1.5, True])])
def test_a_port_that_is_none_is_refused(swing, port: Any) -> None:
    with pytest.raises(rd.RobotDynError, match="port"):
        rd.replay(swing).serve(port)
