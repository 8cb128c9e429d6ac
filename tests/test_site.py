"""The built site: all can read its pages, its replays play from disk, nothing asks a network; `make docs` builds it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from tests.browser import View, opened
from tests.long import long
from tests.view.test_page_access import AXE, screens

SITE = Path(__file__).parents[1] / "build" / "docs"
PAGES = ["README", "how_to/simulate_an_arm", "reference/api/integrate", "gallery/README"]
MORE = [
    "notebooks/4_your_own_controller",
    "reference/commands",
    "start/ten_minutes",
    "explanation/which_method",
    "studies/hard_cases",
    "reference/api/effects",
]
REPLAYS = sorted((SITE / "gallery" / "pages").glob("*.html"))
MOST_BYTES = 15e6  # of the gallery

if not (SITE / "README.html").exists():
    if os.environ.get("CI") == "true":
        pytest.fail("the site is not built: make docs", pytrace=False)
    pytest.skip("the site is not built", allow_module_level=True)


@pytest.mark.parametrize("name", [*PAGES, *long(MORE)])
def test_axe_finds_nothing_serious(browser: Any, name: str) -> None:
    """In either scheme, on wide and narrow screens."""
    view = View(browser.new_context(offline=True).new_page())
    view.page.on("console", lambda m: view.complaints.append(m.text) if m.type == "error" else None)
    view.page.on("request", lambda request: view.requests.append(request.url))
    for width, scheme in screens():
        view.page.set_viewport_size({"width": width, "height": 900})
        view.page.emulate_media(color_scheme=scheme)
        view.page.goto((SITE / f"{name}.html").as_uri())
        view.page.evaluate(f"{AXE}; 0")
        options = "{iframes: false, preload: false}"  # replays in frames are tested in tests/view
        found = view.page.evaluate(f"axe.run(document, {options}).then((all) => [all.violations, all.passes.length])")
        grave = [
            (each["id"], [node["target"] for node in each["nodes"]][:5])
            for each in found[0]
            if each["impact"] in ("serious", "critical")
        ]
        assert not grave, (width, scheme)
        assert found[1] > 15  # it has looked
    assert view.complaints == []
    assert all(url.startswith(("file:", "data:", "blob:", "about:")) for url in view.requests)
    view.page.context.close()


def test_there_are_twelve_replays_of_few_bytes() -> None:
    assert len(REPLAYS) == 12
    assert sum(file.stat().st_size for file in (SITE / "gallery" / "pages").iterdir()) <= MOST_BYTES
    scripts = sorted((SITE.parents[1] / "docs" / "gallery").glob("*.py"))
    assert [each.stem for each in scripts] == [each.stem for each in REPLAYS]
    assert max(len(each.read_text(encoding="utf-8").splitlines()) for each in scripts) <= 30


@pytest.mark.parametrize("file", REPLAYS, ids=lambda file: file.stem)
def test_a_replay_plays_from_disk(browser: Any, file: Path) -> None:
    """With the viewer from the file that all share, offline, without a complaint."""
    with opened(browser, file, offline=True) as view:
        assert view.ask("replay.time") == 0
        view.page.keyboard.press("End")
        assert view.ask("replay.time") == view.ask("replay.duration") > 0
        assert view.complaints == []
        files = {url.rpartition("/")[2] for url in view.requests if not url.startswith(("data:", "blob:"))}
        assert files == {file.name, "viewer.js"}
