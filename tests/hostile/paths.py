"""Paths at which there is no file to read, or none that ends."""

from __future__ import annotations

import os
import socket
from pathlib import Path

from tests.hostile.kinds import ARM, Kind, Make, text


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


NO_FILE, NOT_REGULAR = ("no file", "check the path"), ("not a regular file", "give the path of a URDF file")
KINDS = [
    Kind("a missing file", missing, NO_FILE),
    Kind("a folder", folder, ("is a folder", "give the path of a URDF file")),
    Kind("a FIFO that nobody writes to", fifo, NOT_REGULAR),
    Kind("a socket", unix_socket, NOT_REGULAR),
    Kind("a link to an endless device", link_to("/dev/zero"), NOT_REGULAR),
    Kind("a dangling link", link_to("nowhere"), NO_FILE),
    Kind("a link to itself", link_to("robot.urdf"), NO_FILE),
    Kind("a file that fails when read", at("/proc/self/mem"), ("cannot be read (Input/output error); give the path",)),
    Kind("a path longer than the system takes", lambda path: path.with_name("x" * 300 + ".urdf"),
         ("no file", "File name too long", "give the path of a URDF file")),
    Kind("a path with a NUL", lambda path: path.with_name("a\0.urdf"), ("no file",)),
    Kind("a path in the home of nobody", at("~no_such_user/robot.urdf"), ("no file", "home", "give the path")),
    Kind("a path through a file", lambda path: text(ARM)(path) / "robot.urdf", NO_FILE),
    Kind("a file of 64 GiB of zeros", sparse, ("is larger than 16 MiB", "keep meshes")),
    Kind("a file whose name is not text", lambda path: text(ARM)(path.with_name("arm-\udcff.urdf")), upper=(1, 2)),
]  # fmt: skip
