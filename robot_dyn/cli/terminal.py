"""Output of the command line: without control characters from files, or tracebacks for closed pipes and full disks."""

from __future__ import annotations

import json
import logging
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from robot_dyn.foundations.answer import Answer, Table
from robot_dyn.foundations.errors import RobotDynError, escaped

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_MAX = 4000  # largest number of characters in a message


class OutputError(RobotDynError):
    """Standard output that cannot be written."""


def open_streams() -> None:
    """Open the standard streams that are missing; print unknown characters as ?."""
    while (handle := os.open(os.devnull, os.O_RDWR)) <= 2:  # otherwise a file opened later would get its number
        pass
    os.close(handle)
    if sys.stdout is None:  # closed: writing fails, same as on /dev/full
        sys.stdout = os.fdopen(os.open(os.devnull, os.O_RDONLY), "w", encoding="utf-8")
    if sys.stderr is None:
        sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8")
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="replace")  # pyright: ignore[reportAttributeAccessIssue]


def say(*answers: Answer | Table | str) -> None:
    """Print answers, tables, and texts of one line each.

    A pipe that its reader has closed is not an error: the rest is dropped.

    Raises:
        OutputError: If standard output cannot be written.
    """
    for block in (part for one in answers for part in (one.blocks() if isinstance(one, Answer) else (one,))):
        if isinstance(block, str):
            put(f"{escaped(block)}\n")
        elif sys.stdout.isatty():
            _guarded(lambda table=block: _draw(table))
        else:
            put("\n".join([*block.lines, ""]))


def _draw(table: Table) -> None:
    """Print a table on a terminal: texts are left-aligned and wrapped between words, numbers are right-aligned."""
    from rich.console import Console
    from rich.table import Table as Grid

    console = Console(highlight=False, markup=False, emoji=False)
    for number, part in enumerate(table.within(console.width)):  # never truncate a number
        if number:
            console.print()
        grid = Grid(box=None, pad_edge=False, header_style="bold")
        for heading, wide in zip(part.heading, part.fitted(console.width), strict=True):
            word = heading in part.words
            side = "left" if word else "right"
            grid.add_column(heading, width=wide, no_wrap=not word, overflow="fold", justify=side)
        for row in part.cells:
            grid.add_row(*row)
        console.print(grid)


def show(
    answer: Any,
    *,
    as_json: bool,
    document: Any = None,
    more: Mapping[str, Any] | None = None,
    writes: Iterable[Callable[[], Path]] = (),
) -> None:
    """Write the files of an answer, then print it as text or as JSON. The exit code is 130 if Ctrl-C ended its work.

    Args:
        answer: An answer, or a list of answers, tables and texts.
        as_json: True to print JSON.
        document: Value of the JSON document, if it is not the answer.
        more: Further answers by key.
        writes: Functions that write a file and return its path. They are called first: a terminal or pipe may be gone.
    """
    written: list[Path] = []
    more = more or {}
    try:
        written += [write() for write in writes]
    finally:
        if as_json:
            say_json(answer if document is None else document, **more)
        else:
            parts = answer if isinstance(answer, list | tuple) else [answer]
            say(*parts, *(part for further in more.values() for part in ("", further)))
    for path in written:
        to_stderr(f"written: {path}")
    if getattr(answer, "interrupted", False):
        raise typer.Exit(130)


def say_written(file: Path) -> None:
    """Print that a file was written, with its size."""
    from rich.filesize import decimal

    say(f"written: {file} ({decimal(file.stat().st_size)})")


def put(text: str) -> None:
    """Write a text that ends its own lines; for errors, see `say`."""
    _guarded(lambda: (sys.stdout.write(text), sys.stdout.flush()))


def say_json(value: DataclassInstance | Mapping[str, object], **more: object) -> None:
    """Print a document or a result as JSON, with more keys; for errors, see `say`."""
    from robot_dyn.foundations.result import json_text, plain

    put(re.sub(r"[^\n\x20-\x7e]", lambda match: _json_escaped(match[0]), json_text(plain(value) | more)))


def to_stderr(text: str) -> None:
    """Write one line to standard error, if there is one."""
    line = escaped(text)
    try:
        print(line if len(line) <= _MAX else line[: _MAX - 1] + "…", file=sys.stderr, flush=True)
    except OSError:
        _drop(sys.stderr)


class _ToStderr(logging.Handler):
    """A handler that writes each message as one line to standard error."""

    def emit(self, record: logging.LogRecord) -> None:
        to_stderr(f"robot-dyn: {record.getMessage()}")


@contextmanager
def logged_to_stderr() -> Iterator[None]:
    """Write messages of the library, such as long waits, to standard error during a block."""
    log, handler = logging.getLogger("robot_dyn"), _ToStderr()
    level, propagates = log.level, log.propagate
    log.setLevel(logging.INFO)
    log.addHandler(handler)
    log.propagate = False  # a user-defined part may configure the root logger, which would print it twice
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(level)
        log.propagate = propagates


def finish() -> None:
    """Write the rest of the buffers, before the interpreter does; for errors, see `say`."""
    _guarded(sys.stdout.flush)


def _guarded(write: Any) -> None:
    try:
        write()
    except BrokenPipeError:
        _drop(sys.stdout)
    except OSError as error:
        raise failed(error) from None


def failed(error: OSError) -> OutputError:
    """Return the error for standard output that cannot be written; the rest of its buffer is dropped."""
    _drop(sys.stdout)
    return OutputError(f"standard output cannot be written ({error.strerror}); redirect it elsewhere")


def _drop(stream: Any) -> None:
    """Discard the buffer of a stream, and everything written to it later."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def _json_escaped(letter: str) -> str:
    """Return the letter, or its JSON escape if it is a control character."""
    return letter if escaped(letter) == letter else json.dumps(letter)[1:-1] if ord(letter) != 127 else "\\u007f"
