"""Fixtures of the cache of compiled kernels."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot_dyn.codegen import Store
from tests.codegen.entries import KEY, PAYLOAD


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "made" / "kernels")


@pytest.fixture
def kept(store: Store) -> Path:
    """The file of an entry."""
    store.save(KEY, PAYLOAD, "panda: forward dynamics")
    return store.folder / f"{KEY}.kernel"
