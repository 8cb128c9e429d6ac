"""The cache of compiled kernels: an entry comes back whole or not at all; its folder is the user's alone, or unused."""

from __future__ import annotations

import errno
import json
import os
import resource
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from robot_dyn.codegen import CacheWarning, Store, digest_of_texts
from robot_dyn.codegen.store import cache
from robot_dyn.codegen.store.cache import default_store
from robot_dyn.foundations import QueryError

KEY, OTHER = digest_of_texts(["kernel"]), digest_of_texts(["other"])
PAYLOAD = bytes(range(256)) + b"\n\n end"
posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes are those of POSIX")
as_root = pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root gives files away")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "made" / "kernels")


@pytest.fixture
def kept(store: Store) -> Path:
    """The file of an entry."""
    store.save(KEY, PAYLOAD, "panda: forward dynamics")
    return store.folder / f"{KEY}.kernel"


def assert_gone(store: Store, path: Path) -> None:
    """It does not load, is removed, and can be kept again."""
    assert store.load(KEY) is None
    assert not os.path.lexists(path)
    store.save(KEY, PAYLOAD)
    assert store.load(KEY) == PAYLOAD


@pytest.mark.parametrize("payload", [b"", b"\n", PAYLOAD, os.urandom(100_000)], ids=["empty", "line", "text", "random"])
@pytest.mark.parametrize("about", ["", "panda: M", "two\nlines", "é" * 1000, "\udcff"])
def test_what_is_kept_comes_back(store: Store, payload: bytes, about: str) -> None:
    assert store.load(KEY) is None
    store.save(KEY, payload, about)
    assert store.load(KEY) == payload
    assert store.load(OTHER) is None
    store.save(KEY, payload[::-1], about)
    assert store.load(KEY) == payload[::-1]


@posix
def test_only_this_user_can_enter_or_write(store: Store, kept: Path) -> None:
    assert [stat.S_IMODE(path.stat().st_mode) for path in (store.folder.parent, store.folder)] == [0o700, 0o700]
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600
    assert list(store.folder.iterdir()) == [kept]


def altered(whole: bytes, at: int, how: str) -> bytes:
    return whole[:at] if how == "cut" else whole[:at] + bytes([whole[at] ^ (1 << at % 8)]) + whole[at + 1 :]


@pytest.mark.parametrize("how", ["flipped", "cut"])
def test_a_flipped_bit_anywhere_and_any_other_length_are_found(store: Store, kept: Path, how: str) -> None:
    """In the format, the digest, the key, the label and the payload: every byte of the entry."""
    whole = kept.read_bytes()
    for at in range(len(whole)):
        kept.write_bytes(altered(whole, at, how))
        assert store.load(KEY) is None, at
        assert not kept.exists()
    kept.write_bytes(whole)
    assert store.load(KEY) == PAYLOAD
    kept.write_bytes(whole + b"\0")
    assert_gone(store, kept)


def test_an_entry_under_another_key_is_refused(store: Store, kept: Path) -> None:
    """Whole and one's own, but for another robot."""
    moved = store.folder / f"{OTHER}.kernel"
    kept.rename(moved)
    assert store.load(OTHER) is None
    assert not moved.exists()


def test_an_entry_of_another_format_is_refused(store: Store, kept: Path, monkeypatch) -> None:
    monkeypatch.setattr(cache, "_MAGIC", b"robot_dyn kernel 2\n")
    assert_gone(store, kept)


@posix
def test_a_link_is_not_followed_and_its_target_stays(store: Store, kept: Path, tmp_path: Path) -> None:
    target = kept.rename(tmp_path / "target")
    kept.symlink_to(target)
    assert_gone(store, kept)
    assert target.exists()


@posix
@pytest.mark.parametrize("mode", [0o620, 0o602, 0o666])
def test_an_entry_that_others_can_write_is_refused(store: Store, kept: Path, mode: int) -> None:
    kept.chmod(mode)
    assert_gone(store, kept)


@as_root
def test_an_entry_of_another_user_is_refused(store: Store, kept: Path) -> None:
    os.chown(kept, 12345, -1)
    assert_gone(store, kept)


@posix
@pytest.mark.parametrize("written", [False, True])
def test_a_pipe_neither_blocks_nor_serves(store: Store, kept: Path, written: bool) -> None:
    """Without a writer, and with a whole entry in it."""
    entry = kept.read_bytes()
    kept.unlink()
    os.mkfifo(kept, 0o600)
    pipe = os.open(kept, os.O_RDWR)
    if written:
        os.write(pipe, entry)
    else:
        os.close(pipe)
    assert_gone(store, kept)
    if written:
        os.close(pipe)


def test_a_folder_in_the_place_of_an_entry_is_left(store: Store, kept: Path) -> None:
    kept.unlink()
    kept.mkdir()
    assert store.load(KEY) is None
    with pytest.warns(CacheWarning, match="cannot be written"):
        store.save(KEY, PAYLOAD)
    assert list(store.folder.iterdir()) == [kept]


def age(store: Store, name: str, seconds: float) -> None:
    """Make the entry or file look unused for that long."""
    path = store.folder / name
    then = time.time() - seconds
    os.utime(path, (then, then))


def test_the_entries_not_used_for_longest_go(tmp_path: Path) -> None:
    """Four entries of 1000 bytes and less than 200 of heading fit; reading one makes it young."""
    store = Store(tmp_path / "kernels", max_bytes=4800)
    keys = [digest_of_texts([str(number)]) for number in range(6)]
    for number, name in enumerate(keys[:4]):
        store.save(name, bytes(1000))
        age(store, f"{name}.kernel", 100 - number)
    assert store.load(keys[0]) is not None
    for name in keys[4:]:
        store.save(name, bytes(1000))
    assert {entry.key for entry in store.entries()} == {keys[0], *keys[3:]}
    assert sum(entry.size for entry in store.entries()) <= store.max_bytes


def test_the_entry_just_written_stays_whatever_the_clock_says(tmp_path: Path) -> None:
    store = Store(tmp_path / "kernels", max_bytes=2000)
    store.save(KEY, bytes(1000))
    age(store, f"{KEY}.kernel", -1e6)
    store.save(OTHER, bytes(1000))
    assert [entry.key for entry in store.entries()] == [OTHER]


def test_an_entry_larger_than_the_cache_is_not_kept(store: Store, kept: Path) -> None:
    small = Store(store.folder, max_bytes=1000)
    small.save(OTHER, bytes(1000))
    assert [entry.key for entry in small.entries()] == [KEY]


def test_entries_say_what_they_are(store: Store) -> None:
    store.save(KEY, PAYLOAD, "panda: forward dynamics")
    age(store, f"{KEY}.kernel", 100)
    store.save(OTHER, b"", "two\n lines, a bell \a and é")
    first, second = store.entries()
    assert (first.key, first.about) == (OTHER, "two lines, a bell ? and é")
    assert (second.key, second.about) == (KEY, "panda: forward dynamics")
    assert second.size == (store.folder / f"{KEY}.kernel").stat().st_size
    assert first.used - second.used == pytest.approx(100, abs=10)  # [s], between the two saves


def test_damaged_entries_are_listed_fit_for_a_terminal(store: Store, kept: Path) -> None:
    kept.write_bytes(b"a\nb\nc\n\x1b[31mred\xff\nd")
    assert [entry.about for entry in store.entries()] == ["?[31mred�"]
    kept.write_bytes(b"")
    assert [entry.about for entry in store.entries()] == [""]


def test_clearing_removes_entries_and_nothing_else(store: Store, kept: Path) -> None:
    store.save(OTHER, PAYLOAD)
    others = [store.folder / name for name in ("notes.txt", f"{KEY}.kernel.bak", f"{KEY}x.kernel", "x.kernel")]
    for path in others:
        path.write_bytes(b"mine")
    assert store.clear() == 2
    assert set(store.folder.iterdir()) == set(others)
    assert store.clear() == 0


def test_what_a_killed_writer_left_is_removed_after_an_hour(store: Store, kept: Path) -> None:
    young, old = (store.folder / f"{KEY}{name}.unfinished" for name in ("abc_1234", "abc_5678"))
    for path in (young, old):
        path.write_bytes(b"half")
    age(store, old.name, 4000)
    assert len(store.entries()) == 1
    store.save(OTHER, PAYLOAD)
    assert young.exists()
    assert not old.exists()


WORKER = """
import sys
from pathlib import Path
from robot_dyn.codegen.store.cache import Store
from robot_dyn.codegen.store.keys import digest_of_texts
store = Store(Path(sys.argv[1]), max_bytes=3_000_000)
payloads = {digest_of_texts([str(n)]): bytes([n]) * 500_000 for n in range(4)}
found = 0
for turn in range(16):
    for name, payload in payloads.items():
        store.save(name, payload, f"turn {turn}")
        back = store.load(name)
        assert back in (None, payload), "torn"
        found += back is not None
    if turn % 4 == 3:
        store.clear()
    store.entries()
print(found)
"""


def test_processes_that_write_at_once_never_see_half_an_entry(tmp_path: Path) -> None:
    """Four of them write, read, list, evict and clear; a warning or a torn entry would fail the child."""
    folder = str(tmp_path / "kernels")
    command = [sys.executable, "-W", "error", "-c", WORKER, folder]
    children = [subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) for _ in range(4)]
    for child in children:
        out, err = child.communicate(timeout=120)
        assert (child.returncode, err) == (0, b"")
        assert int(out) > 32  # of 64 readings: else nothing was tried
    assert not [path for path in Path(folder).iterdir() if path.suffix != ".kernel"]


def test_keys_of_different_parts_differ() -> None:
    """Moving a border or adding an empty part makes another key."""
    lists = [(), ("",), ("", ""), ("ab", "c"), ("a", "bc"), ("abc",), ("c", "ab"), ("\udcff",)]
    lists += [("absc",), ("a", "b\0" + "1 c"), ("a", "b", "c"), ("a\0" + "1 b",), ("1 a",)]
    assert len({digest_of_texts(parts) for parts in lists}) == len(lists)
    assert digest_of_texts(["é"]) == digest_of_texts(["é"])
    # SHA-256 of nothing, FIPS 180-4
    assert digest_of_texts([]) == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"


@pytest.mark.parametrize("name", ["", "a", KEY[:-1], KEY + "0", KEY.upper(), KEY + "\n", "../" + KEY, "/etc/passwd"])
def test_what_is_no_key_is_refused(store: Store, name: str) -> None:
    """It would become the name of a file."""
    for call in (lambda: store.load(name), lambda: store.save(name, b"")):
        with pytest.raises(QueryError, match="64 hexadecimal digits"):
            call()


ASK = """
import json, numpy as np, robot_dyn as rd
from robot_dyn.codegen.llvm import machine_code
compiled, object_file = [], machine_code.object_file
machine_code.object_file = lambda *given: compiled.append(given) or object_file(*given)
arm = rd.load("planar_2r")
q, v, tau = np.array([0.3, -0.8]), np.array([0.5, 0.4]), np.array([1.0, -2.0])
one = rd.compiled(arm).forward_dynamics(q, v, tau)
many = rd.compiled(arm).forward_dynamics(np.tile(q, (100, 1)), np.tile(v, (100, 1)), np.tile(tau, (100, 1)))
print(json.dumps([len(compiled), one.tolist(), many[7].tolist()]))
"""


def ask(folder: Path) -> list:
    environment = os.environ | {"ROBOT_DYN_CACHE": str(folder)}
    done = subprocess.run([sys.executable, "-c", ASK], env=environment, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(done.stdout)


def test_a_second_process_compiles_nothing_and_damaged_code_is_compiled_again(tmp_path: Path) -> None:
    first = ask(tmp_path / "kernels")
    second = ask(tmp_path / "kernels")
    assert first[0] > 0
    assert second[0] == 0
    assert second[1:] == first[1:]
    for entry in (tmp_path / "kernels").iterdir():
        damaged = bytearray(entry.read_bytes())
        damaged[len(damaged) // 2] ^= 1
        entry.write_bytes(damaged)
    again = ask(tmp_path / "kernels")
    assert again[0] > 0
    assert again[1:] == first[1:]


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
