"""What machine code depends on, in one key: its program, the source of this package, versions, and the processor."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


def digest(identity: list[str]) -> str:
    """The SHA-256 of what these texts, the package's source, this processor and these versions determine."""
    import llvmlite.binding as llvm

    versions = [f"{name} {version_of(name)}" for name in ("robot-dyn", "llvmlite", "casadi", "numpy")]
    machine = [platform.python_version(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()]
    parts = [*identity, source_digest(), *versions, *machine]
    return hashlib.sha256("\0".join(f"{len(part)} {part}" for part in parts).encode()).hexdigest()


@cache
def source_digest() -> str:
    """The SHA-256 of all modules of robot_dyn: one that is edited must not run what it wrote before."""
    return digest_of_folder(Path(__file__).parents[1])


def digest_of_folder(folder: Path) -> str:
    """The SHA-256 of the names and contents of all Python files in a folder and below it."""
    made = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        data = path.read_bytes()
        made.update(f"{path.relative_to(folder).as_posix()} {len(data)}\n".encode() + data)
    return made.hexdigest()


@cache
def version_of(name: str) -> str:
    """The version of an installed distribution, or "unknown"."""
    try:
        return version(name)
    except PackageNotFoundError:  # run from its folder
        return "unknown"
