"""A real browser for the pages: Debian's Chromium, driven by Playwright."""

from __future__ import annotations

import base64
import io
import os
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import urlparse

import numpy as np
import pytest

from robot_dyn import Robot
from robot_dyn.view import Page

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
# Root needs --no-sandbox; WebGL comes from software; the rest keeps Chromium from asking the network for itself.
FLAGS = [
    "--no-sandbox", "--enable-unsafe-swiftshader", "--use-angle=swiftshader", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
]  # fmt: skip


def chromium() -> str:
    """Its path; without one tests skip, and fail where CI says so."""
    if CHROMIUM is None:
        if os.environ.get("CI") == "true":
            pytest.fail("no Chromium on this machine; install it: apt-get install chromium")
        pytest.skip("no Chromium on this machine")
    return CHROMIUM


@dataclass
class View:
    """A replay page in the browser."""

    page: Any
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def ask(self, script: str) -> Any:
        """The value of an expression in the page; `node(path)` is a node of the viewer's tree."""
        return self.page.evaluate(f"() => {{ {_HELPERS} return {script}; }}")

    def placement(self, path: str) -> np.ndarray:
        """Homogeneous matrix (4, 4) of a node in the scene."""
        return np.array(self.ask(f"matrix(node({path!r}))")).reshape(4, 4).T

    def path(self, link: str, root: str = "run") -> str:
        """Path of a link's node in a robot's tree."""
        return self.ask(f"find(viewer.scene_tree.children[{root!r}], {root!r}, {'link ' + link!r})")

    def stands(self, robot: Robot, q: Any, *links: str, within: float = 2e-6, root: str = "run") -> None:
        """Assert that links are where Pinocchio puts them, within single precision or a tolerance in [m]."""
        for link in links:
            np.testing.assert_allclose(self.placement(self.path(link, root)), robot.placement(q, link), atol=within)

    def bounds(self, path: str) -> np.ndarray:
        """Least and largest coordinates (2, 3) of all vertices that are shown below a node, in the scene."""
        return np.array(self.ask(f"bounds(node({path!r}))"))

    def notes(self) -> list[str]:
        """The notes at the end of the page."""
        return self.ask("[...document.querySelectorAll('#notes li')].map(e => e.textContent)")

    def picture(self) -> np.ndarray:
        """What the canvas shows, (h, w, 3)."""
        from PIL import Image

        url = self.ask("viewer.capture_image()")
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))).convert("RGB")).astype(int)


@contextmanager
def opened(
    browser: Any, where: Page | Path | str, *, size: tuple[int, int] = (900, 800), anchor: str = "",
    complains: bool = False, **options: Any,
) -> Iterator[View]:  # fmt: skip
    """A page once its animation is loaded; in the end it has asked nothing of a network, and has not complained.

    Args:
        browser: The browser.
        where: The page, its file or its address.
        size: Of the window.
        anchor: Put after the address.
        complains: Whether it may complain.
        **options: Of a context of Playwright, such as `offline`.
    """
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, **options)
    view = View(context.new_page())
    view.page.on("console", lambda m: view.complaints.append(m.text) if m.type == "error" else None)
    view.page.on("pageerror", lambda error: view.complaints.append(str(error)))
    view.page.on("dialog", lambda dialog: (view.complaints.append(dialog.message), dialog.dismiss()))
    view.page.on("request", lambda request: view.requests.append(request.url))
    with TemporaryDirectory() as folder:
        file = where.save(Path(folder) / "page.html") if isinstance(where, Page) else where
        view.page.goto((file if isinstance(file, str) else file.absolute().as_uri()) + anchor)
        until(lambda: view.ask("!!(window.replay && viewer.animator.actions.length)"), "the page did not load", view)
        yield view
    context.close()
    assert complains or not view.complaints, view.complaints
    assert all(urlparse(url).hostname in ("127.0.0.1", "", None) for url in view.requests), view.requests


def until(condition: Any, what: str, view: View | None = None, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"{what}; {view.complaints if view else ''}")
        time.sleep(0.05)


_HELPERS = """
const node = (path) => {
  let at = viewer.scene_tree;
  for (const name of path.split('/')) if (!(at = at.children[name])) throw Error(`no ${name} of ${path}`);
  return at.object;
};
const find = (at, path, name) => Object.entries(at.children).reduce((found, [key, child]) =>
  found ?? (key === name ? `${path}/${key}` : find(child, `${path}/${key}`, name)), undefined);
const base = () => { viewer.scene.updateMatrixWorld(true); return viewer.scene.matrixWorld.clone().invert(); };
const matrix = (object) => { const from = base(); return from.multiply(object.matrixWorld).toArray(); };
const bounds = (object) => {
  const from = base(), low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
  object.traverseVisible((part) => {
    if (!part.isMesh) return;
    const place = from.clone().multiply(part.matrixWorld), points = part.geometry.attributes.position;
    for (let i = 0; i < points.count; i++) {
      const p = new MeshCat.THREE.Vector3().fromBufferAttribute(points, i).applyMatrix4(place);
      p.toArray().forEach((x, k) => { low[k] = Math.min(low[k], x); high[k] = Math.max(high[k], x); });
    }
  });
  return [low, high];
};
"""


def without_shapes(robot: Robot) -> Robot:
    """The robot with ellipsoids of its inertias instead of meshes, for which a page takes a third of the time."""
    text = robot.description.xml.decode()
    return Robot.from_text(re.sub(r"<(visual|collision)\b.*?</\1>", "", text, flags=re.DOTALL))
