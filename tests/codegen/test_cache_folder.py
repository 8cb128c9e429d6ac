"""The folder of the cache: yours alone, or no cache; and what fails in it loses nothing."""

from __future__ import annotations

import errno
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from robot_dyn.codegen import CacheWarning, Store
from robot_dyn.codegen.store import cache
from robot_dyn.codegen.store.cache import default_store
from tests.codegen.entries import KEY, OTHER, PAYLOAD, as_root, posix


def spoil(folder: Path, how: str) -> None:
    if how == "link":
        real = folder.rename(folder.with_name("real"))
        folder.symlink_to(real, target_is_directory=True)
    elif how == "dangling":
        folder.rename(folder.with_name("real"))
        folder.symlink_to(folder.with_name("nowhere"), target_is_directory=True)
    elif how == "file":
        folder.rename(folder.with_name("real"))
        folder.write_bytes(b"")
    elif how == "owner":
        os.chown(folder, 12345, -1)
    else:
        folder.chmod(int(how, 8))


SPOILT = [
    ("link", "is a link"), ("dangling", "is a link"), ("file", "is not a folder"), ("0755", "mode 0755"),
    ("0770", "mode 0770"), ("0701", "mode 0701"), pytest.param("owner", "owner 12345", marks=as_root),
]  # fmt: skip


@posix
@pytest.mark.parametrize(("how", "said"), SPOILT)
def test_a_folder_that_is_not_yours_alone_is_no_cache(store: Store, kept: Path, monkeypatch, how: str, said) -> None:
    """Neither read, listed, written nor cleared; said once, with a remedy."""
    spoil(store.folder, how)
    assert store.load(KEY) is None
    assert (store.entries(), store.clear()) == ((), 0)
    with pytest.warns(CacheWarning, match=said) as caught:
        store.save(OTHER, PAYLOAD)
    assert len(caught) == 1
    real = store.folder.with_name("real") if store.folder.with_name("real").exists() else store.folder
    assert [path.name for path in real.iterdir()] == [kept.name]

    monkeypatch.setenv("ROBOT_DYN_CACHE", str(store.folder))
    with pytest.warns(CacheWarning, match=f"{said}.*ROBOT_DYN_CACHE, or set it to off") as caught:
        assert default_store() is None
    assert len(caught) == 1


@posix
def test_the_folder_above_the_default_one_is_held_to_the_same(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.delenv("ROBOT_DYN_CACHE", raising=False)
    own = tmp_path / "robot_dyn"
    monkeypatch.setattr(cache.platformdirs, "user_cache_path", lambda *_, **__: own)
    assert default_store() == Store(own / "kernels")
    assert not own.exists()  # to ask makes nothing
    Store(own / "kernels").save(KEY, PAYLOAD)
    assert default_store() == Store(own / "kernels")
    own.chmod(0o777)
    with pytest.warns(CacheWarning, match="mode 0777"):
        assert default_store() is None


@pytest.mark.parametrize("value", ["", "off", "OFF", " off "])
def test_the_cache_can_be_switched_off(monkeypatch, value: str) -> None:
    monkeypatch.setenv("ROBOT_DYN_CACHE", value)
    assert default_store() is None


def test_the_cache_can_be_elsewhere(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setenv("ROBOT_DYN_CACHE", str(tmp_path / "mine"))
    assert default_store() == Store(tmp_path / "mine")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("ROBOT_DYN_CACHE", "~/mine")
    assert default_store() == Store(tmp_path / "mine")
    monkeypatch.setenv("ROBOT_DYN_CACHE", "here")
    with pytest.warns(CacheWarning, match="is not a full path"):
        assert default_store() is None


def test_the_same_warning_is_shown_once(tmp_path: Path) -> None:
    """However often and from wherever it comes, under Python's own filters."""
    code = f"""
from pathlib import Path
from robot_dyn.codegen.store.cache import Store
from robot_dyn.codegen.store.keys import digest_of_texts
store = Store(Path({str(tmp_path)!r}) / "file")
store.folder.write_bytes(b"")
for _ in range(3):
    store.save(digest_of_texts(["a"]), b"")
store.save(digest_of_texts(["b"]), b"")
"""
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert child.stderr.count("CacheWarning: ") == 1


@pytest.mark.parametrize("call", ["mkstemp", "replace"])
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EDQUOT])
def test_a_write_that_fails_warns_and_leaves_what_was(store: Store, kept: Path, monkeypatch, call, number: int) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as patch:
        patch.setattr(cache.os if call == "replace" else cache.tempfile, call, fail)
        with pytest.warns(CacheWarning, match=os.strerror(number)) as caught:
            store.save(KEY, b"new")
    assert len(caught) == 1
    assert list(store.folder.iterdir()) == [kept]
    assert store.load(KEY) == PAYLOAD


@posix
def test_a_disk_that_is_full_midway_leaves_what_was(store: Store, kept: Path) -> None:
    """A limit on the size of files fails as a full disk does: within the write."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        with pytest.warns(CacheWarning, match="cannot be written"):
            store.save(KEY, bytes(100_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(store.folder.iterdir()) == [kept]
    assert store.load(KEY) == PAYLOAD


def test_a_folder_that_cannot_be_made_warns(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    store = Store(tmp_path / "file" / "kernels")
    assert (store.load(KEY), store.entries(), store.clear()) == (None, (), 0)
    with pytest.warns(CacheWarning, match="cannot be written"):
        store.save(KEY, PAYLOAD)


def test_what_is_read_is_kept_even_if_its_time_cannot_be_set(store: Store, kept: Path, monkeypatch) -> None:
    def read_only(*_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(cache.os, "utime", read_only)
    assert store.load(KEY) == PAYLOAD
    assert kept.exists()
