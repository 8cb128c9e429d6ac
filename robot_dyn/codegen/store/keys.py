"""Keys: SHA-256 digests of everything that stored code depends on, so that equal keys mean equal contents.

    machine code of a kernel        its program, the source of the writer (`sources_of_the_writer`), its form
    machine code of a loop          the code of all functions it reaches (`loops.dependencies`), the types of its
                                    arguments, the source of the translator (`sources_of_the_translator`)
    programs of a state equation    its structure, with the definitions of user code (`store.definition`), and the
                                    source of all code that may be traced (`sources_of_programs`), for any processor

All keys include versions; those of machine code include the processor.
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
# Packages above the simulation, which traced code cannot import: the layers in pyproject.toml ensure this.
_ABOVE = {"accuracy", "cli", "report", "scene", "tools", "view"}


def digest(texts: list[str], *, processor: bool = True) -> str:
    """Return the key of texts, versions and the processor; callers include the digests of sources in the texts."""
    versions = [f"{name} {version_of(name)}" for name in ("robot-dyn", "llvmlite", "casadi", "numpy")]
    return digest_of_texts([*texts, *versions, platform.python_version(), *(processor_of_code() if processor else ())])


def digest_of_texts(texts: Iterable[str]) -> str:
    """Return the SHA-256 of texts, in hex; each is preceded by its length, so that no two lists share their bytes."""
    joined = "\0".join(f"{len(text)} {text}" for text in texts)
    return hashlib.sha256(joined.encode("utf-8", "surrogatepass")).hexdigest()


def processor_of_code() -> tuple[str, ...]:
    """Return the name and features of the processor that machine code is compiled for, and "portable" if it is that."""
    from robot_dyn.codegen.llvm.target import this_target

    return this_target().key


@cache
def sources_of_the_writer() -> str:
    """Return the SHA-256 of the code that writes programs as machine code."""
    return digest_of_files(_CODEGEN, [*(_CODEGEN / "llvm").rglob("*.py"), _CODEGEN / "program.py"])


@cache
def sources_of_the_translator() -> str:
    """Return the SHA-256 of the code that translates loops to machine code."""
    rooms = [*(_CODEGEN / "loops").glob("*.py"), *(_CODEGEN / "llvm").glob("*.py")]
    # array_operations emits instructions itself, so that the code of translated functions does not include it
    return digest_of_files(_CODEGEN, [*rooms, _CODEGEN / "array_operations.py"])


@cache
def sources_of_programs() -> str:
    """Return the SHA-256 of all code that traces programs or may be traced."""
    return digest_of_files(_ROOT, traced_sources())


def traced_sources() -> list[Path]:
    """Return the modules of this package except those above the simulation."""
    rooms = [room for room in _ROOT.iterdir() if room.name not in _ABOVE]
    return [path for room in rooms for path in ([room] if room.suffix == ".py" else room.rglob("*.py"))]


def digest_of_files(folder: Path, paths: Iterable[Path]) -> str:
    """Return the SHA-256 of the contents of files, and of their names relative to a folder."""
    result, prefix = hashlib.sha256(), len(folder.as_posix()) + 1
    for name in sorted(path.as_posix() for path in paths):
        with open(name, "rb") as file:
            data = file.read()
        result.update(f"{name[prefix:]} {len(data)}\n".encode() + data)
    return result.hexdigest()
