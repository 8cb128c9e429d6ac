"""An entry of the cache of compiled kernels, and what tests of it share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from robot_dyn.codegen import Store, digest_of_texts

KEY, OTHER = digest_of_texts(["kernel"]), digest_of_texts(["other"])
PAYLOAD = bytes(range(256)) + b"\n\n end"
posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes are those of POSIX")
as_root = pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root gives files away")


def assert_gone(store: Store, path: Path) -> None:
    """It does not load, is removed, and can be kept anew."""
    assert store.load(KEY) is None
    assert not os.path.lexists(path)
    store.save(KEY, PAYLOAD)
    assert store.load(KEY) == PAYLOAD
