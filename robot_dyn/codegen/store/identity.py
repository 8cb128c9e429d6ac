"""What machine code depends on, in one key: its program, the sources of what writes it, versions, and the processor."""

from __future__ import annotations

import hashlib
import platform
import re
from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

_ROOT = Path(__file__).parents[2]
# Rooms above the simulation, which nothing that is traced imports: the layers in pyproject.toml see to it.
_ABOVE = {"cli", "scene", "studies", "view"}


def digest(identity: list[str], *, processor: bool = True) -> str:
    """The SHA-256 of what these texts and versions determine, and the processor; sources are among the texts."""
    versions = [f"{name} {version_of(name)}" for name in ("robot-dyn", "llvmlite", "casadi", "numpy")]
    parts = [*identity, *versions, platform.python_version(), *(_processor() if processor else ())]
    return hashlib.sha256("\0".join(f"{len(part)} {part}" for part in parts).encode()).hexdigest()


def _processor() -> tuple[str, str]:
    import llvmlite.binding as llvm

    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


@cache
def sources_of_the_writer() -> str:
    """The SHA-256 of what writes programs as machine code."""
    room = _ROOT / "codegen"
    return digest_of(room, [*(room / "llvm").rglob("*.py"), room / "program.py"])


@cache
def sources_of_programs() -> str:
    """The SHA-256 of all that may be traced to a program, or traces it."""
    return digest_of(_ROOT, traced_sources())


def traced_sources() -> list[Path]:
    """The modules of this package but for those above the simulation."""
    rooms = [room for room in _ROOT.iterdir() if room.name not in _ABOVE]
    return [path for room in rooms for path in ([room] if room.suffix == ".py" else room.rglob("*.py"))]


def digest_of(folder: Path, paths: Iterable[Path]) -> str:
    """The SHA-256 of the names, from a folder on, and of the contents of files."""
    made, before = hashlib.sha256(), len(folder.as_posix()) + 1
    for name in sorted(path.as_posix() for path in paths):
        with open(name, "rb") as file:
            data = file.read()
        made.update(f"{name[before:]} {len(data)}\n".encode() + data)
    return made.hexdigest()


@cache
def version_of(name: str) -> str:
    """The version of an installed distribution, or "unknown"."""
    try:
        found = distribution(name)
    except PackageNotFoundError:  # run from its folder
        return "unknown"
    head = re.search("^Version: (.*)$", found.read_text("METADATA") or "", re.MULTILINE)
    return head[1] if head else found.version  # which takes a parser of mails
