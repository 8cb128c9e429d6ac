"""Numbers of runs by reason of failure and by remark, and of chunks by processor, from the folder of a sweep."""

from __future__ import annotations

import re
from collections import Counter
from hashlib import sha256

import numpy as np

from robot_dyn.tools.sweeps.folder.folder import Folder
from robot_dyn.tools.sweeps.folder.rows import FINISHED

_NUMBER = re.compile(r"(?<![\w.])[-+]?\d[\d.]*(?:e[-+]?\d+)?")


def reasons(folder: Folder) -> dict[str, int]:
    """Runs by reason of failure, the most frequent first; those that differ in numbers alone under the first one."""
    columns = folder.columns(("outcome", "reason"))
    first, count = dict[str, str](), Counter[str]()
    for text in columns["reason"][columns["outcome"] != FINISHED].tolist():
        count[first.setdefault(_NUMBER.sub("…", text), text)] += 1
    return dict(count.most_common())


def remarks(folder: Folder) -> dict[str, int]:
    """Runs by what a remark on them is about, the most frequent first."""
    found = Counter[str]()
    for texts, count in Counter(folder.columns(("remarks",))["remarks"].tolist()).items():
        found.update(dict.fromkeys(filter(None, texts.split("; ")), count))
    return dict(found.most_common())


def processors(folder: Folder) -> dict[str, int]:
    """Chunks that are done by processor and its features."""
    found = Counter[str]()
    for chunk in np.flatnonzero(folder.present()).tolist():
        footer = folder.footer(chunk)
        features = sha256(str(footer.get("features")).encode()).hexdigest()[:8]
        found[f"{footer.get('processor')} (features {features})"] += 1
    return dict(found)
