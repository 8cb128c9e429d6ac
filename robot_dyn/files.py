"""Files written whole or not at all."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from secrets import token_hex
from typing import BinaryIO

from robot_dyn.errors import RobotDynError


def target(path: str | Path, suffix: str, error: type[RobotDynError]) -> Path:
    """The path of a file to write, with the suffix if it has none; `error` if it names no file."""
    path = Path(path)
    if not path.name or path.is_dir():
        raise error(f"{path}: is a folder; give the name of a file in it, such as {path / ('run' + suffix)}")
    return path if path.suffix else path.with_suffix(suffix)


def save(path: Path, write: Callable[[BinaryIO], object], error: type[RobotDynError]) -> Path:
    """Write beside the target and rename: a reader sees the old file or the new one, never half of it.

    Raises:
        RobotDynError: Of the kind `error`, if it cannot be written.
    """
    try:
        beside = path.with_name(f".{path.name[:200]}.{token_hex(8)}")  # a tempfile would be its owner's alone
        try:
            with beside.open("xb") as stream:
                write(stream)
            beside.replace(path)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise
    except OSError as cause:
        raise error(f"{path}: cannot be written ({cause.strerror}); give a path in a folder that is writable") from None
    return path
