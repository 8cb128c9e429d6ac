"""Keys: SHA-256 digests of everything that stored code depends on, so that equal keys have equal contents.

    machine code of a kernel        its program, what writes it (`sources_of_the_writer`), its form
    machine code of a loop          the code of all that it reaches (`loops.dependencies`), the types of its arguments,
                                    what translates it (`sources_of_the_translator`)
    programs of a state equation    its structure, with the definitions of user code (`store.definition`), and
                                    everything that may be traced (`sources_of_programs`); for any processor

Versions are in all of them, and the processor in those of machine code.
"""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from robot_dyn.foundations.extras import version_of

_ROOT = Path(__file__).parents[2]
_CODEGEN = _ROOT / "codegen"
# Rooms above the simulation, which nothing that is traced imports: the layers in pyproject.toml ensure it.
_ABOVE = {"accuracy", "cli", "report", "scene", "tools", "view"}


def digest(texts: list[str], *, processor: bool = True) -> str:
    """The key of what these texts, versions and the processor determine; sources are among the texts."""
    versions = [f"{name} {version_of(name)}" for name in ("robot-dyn", "llvmlite", "casadi", "numpy")]
    return digest_of_texts([*texts, *versions, platform.python_version(), *(processor_of_code() if processor else ())])


def digest_of_texts(texts: Iterable[str]) -> str:
    """The SHA-256 of texts, in hex; the length precedes each, so that no two lists share their bytes."""
    joined = "\0".join(f"{len(text)} {text}" for text in texts)
    return hashlib.sha256(joined.encode("utf-8", "surrogatepass")).hexdigest()


def processor_of_code() -> tuple[str, str]:
    """Name and features of the processor that machine code is made for."""
    import llvmlite.binding as llvm

    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


@cache
def sources_of_the_writer() -> str:
    """The SHA-256 of what writes programs as machine code."""
    return digest_of_files(_CODEGEN, [*(_CODEGEN / "llvm").rglob("*.py"), _CODEGEN / "program.py"])


@cache
def sources_of_the_translator() -> str:
    """The SHA-256 of what translates loops to machine code."""
    rooms = [*(_CODEGEN / "loops").glob("*.py"), *(_CODEGEN / "llvm").glob("*.py")]
    return digest_of_files(
        _CODEGEN, [*rooms, _CODEGEN / "array_operations.py"]
    )  # no translated code shows what it writes


@cache
def sources_of_programs() -> str:
    """The SHA-256 of all that may be traced to a program, or traces it."""
    return digest_of_files(_ROOT, traced_sources())


def traced_sources() -> list[Path]:
    """The modules of this package except those above the simulation."""
    rooms = [room for room in _ROOT.iterdir() if room.name not in _ABOVE]
    return [path for room in rooms for path in ([room] if room.suffix == ".py" else room.rglob("*.py"))]


def digest_of_files(folder: Path, paths: Iterable[Path]) -> str:
    """The SHA-256 of the contents of files, and of their names below a folder."""
    result, prefix = hashlib.sha256(), len(folder.as_posix()) + 1
    for name in sorted(path.as_posix() for path in paths):
        with open(name, "rb") as file:
            data = file.read()
        result.update(f"{name[prefix:]} {len(data)}\n".encode() + data)
    return result.hexdigest()
