"""Versions and processor, which a measured time depends on."""

from __future__ import annotations

import platform
import re
from collections.abc import Iterable
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = ("robot-dyn", "pin", "numpy", "scipy", "llvmlite", "casadi", "mujoco", "drake", "heyoka")


def processor_and_versions(packages: Iterable[str] = _PACKAGES) -> dict[str, str]:
    """Return the processor, and the versions of installed packages by name."""
    info = Path("/proc/cpuinfo")  # Linux; elsewhere the name of the architecture is used
    models = re.findall(r"model name\s*: (.*)", info.read_text() if info.exists() else "")
    versions = {"processor": (models or [platform.processor()])[0], "python": platform.python_version()}
    for name in packages:
        with suppress(PackageNotFoundError):
            versions[name] = version(name)
    return versions
