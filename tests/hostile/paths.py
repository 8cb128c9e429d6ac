"""Paths at which there is no file to read, or none that ends."""

from __future__ import annotations

import os
import socket
from pathlib import Path

from tests.hostile.kinds import ARM, Make, text


def missing(path: Path) -> Path:
    return path


def folder(path: Path) -> Path:
    path.mkdir()
    return path


def fifo(path: Path) -> Path:
    os.mkfifo(path)
    return path


def unix_socket(path: Path) -> Path:
    here = Path.cwd()
    os.chdir(path.parent)  # the name of a socket has 107 bytes at most
    try:
        with socket.socket(socket.AF_UNIX) as bound:
            bound.bind(path.name)
    finally:
        os.chdir(here)
    return path


def link_to(target: str) -> Make:
    def make(path: Path) -> Path:
        path.symlink_to(target)
        return path

    return make


def sparse(path: Path) -> Path:
    with path.open("wb") as stream:
        stream.truncate(64 << 30)
    return path


def at(path: str) -> Make:
    return lambda _: Path(path)


KINDS: dict[str, Make] = {
    "a missing file": missing,
    "a folder": folder,
    "a FIFO that nobody writes to": fifo,
    "a socket": unix_socket,
    "a link to an endless device": link_to("/dev/zero"),
    "a dangling link": link_to("nowhere"),
    "a link to itself": link_to("robot.urdf"),
    "a file that fails when read": at("/proc/self/mem"),
    "a path longer than the system takes": lambda path: path.with_name("x" * 300 + ".urdf"),
    "a path with a NUL": lambda path: path.with_name("a\0.urdf"),
    "a path in the home of nobody": at("~no_such_user/robot.urdf"),
    "a path through a file": lambda path: text(ARM)(path) / "robot.urdf",
    "a file of 64 GiB of zeros": sparse,
    "a file whose name is not text": lambda path: text(ARM)(path.with_name("arm-\udcff.urdf")),
}
