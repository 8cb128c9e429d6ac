"""Every page of examples/textbook runs as a student runs it, and its printed residual is small."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "examples" / "textbook").glob("*.py"))


def test_the_pages_are_there() -> None:
    assert len(PAGES) >= 5


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_page_runs_and_its_residual_is_small(page: Path) -> None:
    """DOP853 at rtol 1e-11 or less over some 10² steps keeps 1e-9 of quantities of order 10; warnings are errors."""
    done = subprocess.run(
        [sys.executable, "-W", "error", str(page)], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    (residual,) = re.findall(r"^residual: (\S+)$", done.stdout, flags=re.MULTILINE)
    assert float(residual) < 1e-9
    assert len(page.read_text().splitlines()) <= 60  # a page
