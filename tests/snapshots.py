"""Whole texts that tests compare: tests/snapshots/NAME.json, a text for each case.

`ROBOT_DYN_SNAPSHOTS=renew python -m pytest tests/cli` writes those of the tests that run; read the difference then.
"""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

FOLDER = Path(__file__).parent / "snapshots"
_FOLDERS = re.compile(r"(?<![\w.])/(?:[^\s/:;,'\"]+/)+")  # of absolute paths, which differ between machines


def assert_text(name: str, case: str, text: str) -> None:
    """The text of a case is that of the snapshot; the folders of absolute paths are not compared."""
    file = FOLDER / f"{name}.json"
    texts = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    case, text = (_FOLDERS.sub("…/", each) for each in (case, text))
    if os.environ.get("ROBOT_DYN_SNAPSHOTS") == "renew":
        texts[case] = text
        file.write_text(json.dumps(texts, ensure_ascii=False, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    assert text == texts.get(case)
