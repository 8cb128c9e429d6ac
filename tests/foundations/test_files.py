"""Files that are written: whole or not at all, through links, with their permissions, only over their own kind."""

from __future__ import annotations

import os
import re
import stat
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from errno import EIO, ENOSPC
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.foundations import FileKind, QueryError, files, save, target
from tests.foundations.faults import failing_at, raising
from tests.simulation.test_run_file import run  # noqa: F401  the fixture

NOTE = FileKind("a note", ".note", b"note")
OLD, NEW = b"note: old", b"note: new, and longer than one buffer " + bytes(100_000)


def written(path: Path, content: bytes = NEW) -> Path:
    half = len(content) // 2
    return save(
        target(path, NOTE, QueryError), lambda f: [f.write(x) for x in (content[:half], content[half:])], QueryError
    )


@pytest.fixture
def old(tmp_path: Path) -> Path:
    path = tmp_path / "x.note"
    path.write_bytes(OLD)
    return path


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


# --- faults at every call


@pytest.mark.parametrize("error", [OSError(ENOSPC, "full"), OSError(EIO, "broken"), MemoryError(), KeyboardInterrupt()])
@pytest.mark.parametrize("there", [True, False])
def test_whichever_call_fails_the_old_file_or_the_new_one_is_whole(tmp_path: Path, error, there: bool) -> None:
    """Faults at the 1st, 2nd, … call until there are no more; nothing is left beside the file."""
    path = tmp_path / "x.note"
    for k in range(1, 100):
        path.write_bytes(OLD) if there else path.unlink(missing_ok=True)
        told = None
        with failing_at(k, raising(error)) as faults:
            try:
                written(path)
            except (RobotDynError, KeyboardInterrupt) as failure:
                told = failure
        assert names(tmp_path) in ([["x.note"]] if there else [[], ["x.note"]]), k
        content = path.read_bytes() if path.exists() else None
        assert content in (NEW, OLD if there else None), k
        if told is None:
            assert content == NEW, k
        elif not isinstance(error, KeyboardInterrupt):
            assert re.search("cannot be (read|written)", str(told))  # read: the first bytes of the old file
        if not faults.happened:
            break
    assert 8 < k < 99, k  # open, fdopen, writes, flush, chmod, fsync, replace, … were among them


@pytest.mark.parametrize("what", ["run", "table", "parquet", "nc", "mcap"])
def test_whatever_is_saved_survives_a_fault_at_each_call(run, tmp_path: Path, what: str) -> None:  # noqa: F811
    """The same through the public functions, whose formats write in many pieces, and close in their own ways."""
    name = {"run": "x.npz", "table": "x.csv"}.get(what, f"x.{what}")
    for package in {"parquet": ["pyarrow"], "nc": ["xarray"], "mcap": ["mcap_ros2"]}.get(what, ()):
        pytest.importorskip(package)
    path = run.save(tmp_path / name)
    before = path.read_bytes()
    for k in (*range(1, 12), *range(12, 400, 37)):
        with failing_at(k, raising(OSError(ENOSPC, "full"))) as faults:
            try:
                run.save(path)
            except RobotDynError as error:
                assert re.search(r"cannot be (read|written) \(full\)", str(error)), k
            else:
                before = path.read_bytes()
        assert path.read_bytes() == before, k
        assert names(tmp_path) == [name], k
        if not faults.happened:
            break


KILLED = """
import os, sys
from pathlib import Path
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.files import save
from tests.foundations.faults import failing_at
with failing_at(int(sys.argv[1]), lambda: os._exit(9)):
    save(Path(sys.argv[2]), lambda stream: stream.write(b"note: new"), QueryError)
"""


@pytest.mark.skipif(os.name != "posix", reason="locks of POSIX")
@pytest.mark.parametrize("k", [2, 3, 5, 8])
def test_what_a_killed_writer_left_goes_with_the_next_save(old: Path, k: int) -> None:
    """The old file is whole or the new one is; the next save removes what is left, once it is not new."""
    subprocess.run([sys.executable, "-c", KILLED, str(k), str(old)], check=False, timeout=60)
    left = [path for path in old.parent.iterdir() if path != old]
    assert old.read_bytes() in (OLD, b"note: new")
    assert left or old.read_bytes() != OLD
    other = old.with_name(".y.note.0123456789abcdef.unfinished")
    other.touch()
    for path in (*left, other):
        os.utime(path, (0, 0))
    written(old)
    assert names(old.parent) == sorted([old.name, other.name])  # another target's stays


@pytest.mark.skipif(os.name != "posix", reason="locks of POSIX")
def test_a_file_that_is_being_written_is_not_taken_for_abandoned(old: Path) -> None:
    def write(stream) -> None:
        (beside,) = set(old.parent.iterdir()) - {old}
        os.utime(beside, (0, 0))
        written(old, OLD)  # another save of the same file meanwhile
        stream.write(NEW)

    save(old, write, QueryError)
    assert old.read_bytes() == NEW
    assert names(old.parent) == [old.name]


def test_savers_at_the_same_time_leave_one_whole_file(old: Path) -> None:
    contents = [b"note %d " % i * 5000 for i in range(8)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda content: written(old, content), contents * 4))
    assert old.read_bytes() in contents
    assert names(old.parent) == [old.name]


# --- links and permissions


@pytest.mark.skipif(os.name != "posix", reason="links and permissions of POSIX")
def test_links_are_written_through(old: Path, tmp_path: Path) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    old = old.rename(folder / old.name)
    link = tmp_path / "link.note"
    link.symlink_to(Path("elsewhere") / old.name)
    (tmp_path / "new.note").symlink_to(folder / "to come.note")
    assert written(link) == link
    written(tmp_path / "new.note")
    assert link.is_symlink() and (tmp_path / "new.note").is_symlink()
    assert old.read_bytes() == (folder / "to come.note").read_bytes() == NEW
    assert names(folder) == ["to come.note", "x.note"]


@pytest.mark.skipif(os.name != "posix", reason="links and permissions of POSIX")
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o666])
def test_permissions_stay_and_new_files_have_the_users(old: Path, mode: int) -> None:
    old.chmod(mode)
    written(old)
    assert stat.S_IMODE(old.stat().st_mode) == mode
    before = os.umask(0o027)
    try:
        new = written(old.with_name("new.note"))
    finally:
        os.umask(before)
    assert stat.S_IMODE(new.stat().st_mode) == 0o640


@pytest.mark.skipif(os.name != "posix", reason="links and permissions of POSIX")
def test_nobody_else_reads_a_private_file_while_it_is_written(old: Path) -> None:
    old.chmod(0o600)

    def write(stream) -> None:
        assert not stat.S_IMODE(os.fstat(stream.fileno()).st_mode) & 0o077

    save(old, write, QueryError)


# --- what is refused


def refused(message: str, path: Path, *inputs: Path) -> None:
    before = {each: each.read_bytes() for each in path.parent.rglob("*") if each.is_file()}
    with pytest.raises(QueryError, match=message):
        target(path, NOTE, QueryError, inputs)
    assert before == {each: each.read_bytes() for each in path.parent.rglob("*") if each.is_file()}


def test_names_of_other_kinds_and_missing_folders_are_refused(old: Path, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    refused("is a folder", tmp_path / "folder")
    refused("there is no folder .*none; create it first", tmp_path / "none" / "x.note")
    refused("there is no folder", old / "y.note")
    refused(r"'\.txt' is not a suffix for a note; use \.note", tmp_path / "x.txt")
    refused("embedded null", tmp_path / "x\0.note")
    refused("too long", tmp_path / ("x" * 5000))
    assert target(tmp_path / "y", NOTE, QueryError) == tmp_path / "y.note"
    assert target(tmp_path / "Y.NOTE", NOTE, QueryError) == tmp_path / "Y.NOTE"
    with pytest.raises(QueryError, match="path must be the path of a file"):
        target(None, NOTE, QueryError)  # type: ignore[arg-type]


def test_a_file_of_another_kind_is_not_replaced(old: Path) -> None:
    old.write_text("something else")
    refused("is not a note, so it is not replaced", old)
    old.write_bytes(b"")
    assert target(old, NOTE, QueryError) == old


@pytest.mark.skipif(os.name != "posix", reason="links and pipes of POSIX")
def test_an_input_is_not_replaced_under_any_name(old: Path, tmp_path: Path) -> None:
    link, hard, loop = tmp_path / "link.note", tmp_path / "hard.note", tmp_path / "loop.note"
    link.symlink_to(old)
    os.link(old, hard)
    loop.symlink_to(loop)
    for path in (old, link, hard, tmp_path / "." / ".." / tmp_path.name / "x.note"):
        refused("is the same file as the input", path, old)
    refused("is the same file as", old, hard)
    refused("link to itself", loop)
    dangling = tmp_path / "dangling.note"
    dangling.symlink_to(tmp_path / "to come.note")
    refused("is the same file as", dangling, tmp_path / "to come.note")


@pytest.mark.skipif(os.name != "posix", reason="links and pipes of POSIX")
def test_pipes_and_devices_are_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "x.note")
    refused("is not a regular file", tmp_path / "x.note")
    (tmp_path / "y.note").symlink_to("/dev/null")
    refused("is not a regular file", tmp_path / "y.note")


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="permissions do not hold for root")
def test_closed_folders_and_protected_files_are_refused(old: Path, tmp_path: Path) -> None:
    old.chmod(0o400)
    refused("is write-protected", old)
    tmp_path.chmod(0o500)
    try:
        refused("is not writable", tmp_path / "new.note")
    finally:
        tmp_path.chmod(0o700)


def test_the_public_functions_replace_their_own_kind_and_no_other(run, tmp_path: Path) -> None:  # noqa: F811
    """As numpy.save replaces; but a scene under a link named run.npz stays."""
    page, figure = rd.replay(run), rd.plot(run)
    savers = ((run.save, "x.npz"), (run.save, "x.csv"), (partial(figure.save, dpi=20), "x.png"), (page.save, "x.html"))
    for write, name in savers:
        path = write(tmp_path / name)
        write(path)
        path.write_text("robot = 'pendulum'")
        with pytest.raises(RobotDynError, match="so it is not replaced"):
            write(path)
        with pytest.raises(RobotDynError, match=r"'\.toml' is not a suffix"):
            write(tmp_path / "x.toml")
        assert path.read_text() == "robot = 'pendulum'"


# --- reading


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("none", "there is no such file; help"),
        ("/dev/zero", "is not a regular file; help"),
        (".", "is a folder; help"),
        ("\0", "null"),
        (None, "path must be the path of a file, got None"),
        (3, "path must be the path of a file, got 3"),
        ("x" * 5000, "cannot be read"),
    ],
)
def test_only_regular_files_are_read(what, message: str) -> None:
    with pytest.raises(QueryError, match=message):
        files.read(what, 10, QueryError, "help")
    with pytest.raises(RobotDynError, match=message.partition(";")[0]):
        rd.read(what)


def test_reads_are_bounded(old: Path) -> None:
    assert files.read(old, len(OLD), QueryError, "help") == OLD
    assert files.read_start(old, 4, QueryError, "help") == b"note"
    with pytest.raises(QueryError, match=re.escape(f"{old}: is larger than")):
        files.read(old, len(OLD) - 1, QueryError, "help")


def test_a_run_that_is_saved_reads_as_it_was(run, tmp_path: Path) -> None:  # noqa: F811
    """The stream that formats write to is the file itself, for seeking too."""
    np.testing.assert_array_equal(rd.read(run.save(tmp_path / "x")).q, run.q)
