"""An install of four packages answers queries and runs; other packages are named where they are needed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

TOUR = Path(__file__).parents[1] / ".ci" / "small.py"
# The finders of this process, without the packages of a full install.
BLOCKED = """import runpy, sys
from importlib import metadata
missing = {"scipy", "casadi", "llvmlite", "matplotlib", "pydantic", "pydantic_core", "trimesh", "typer", "rich",
    "yourdfpy", "flint", "PIL", "meshcat", "collada"}
class Without:
    def __init__(self, finder):
        self.finder = finder
    def find_spec(self, name, path=None, target=None):
        return None if name.partition(".")[0] in missing else self.finder.find_spec(name, path, target)
    def __getattr__(self, name):
        return getattr(self.finder, name)
sys.meta_path[:] = map(Without, sys.meta_path)
known = metadata.distribution
def distribution(name):
    if name == "example-robot-data":
        raise metadata.PackageNotFoundError(name)
    return known(name)
metadata.distribution = distribution
runpy.run_path(sys.argv[1], run_name="__main__")"""


@pytest.mark.skipif(not TOUR.exists(), reason="the source distribution has no .ci")
def test_four_packages_are_enough_for_queries_and_runs() -> None:
    done = subprocess.run([sys.executable, "-c", BLOCKED, str(TOUR)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_other_libraries_see_no_difference() -> None:
    """A missing package is None for `find_spec`, and ModuleNotFoundError for code outside this package."""
    code = BLOCKED.rpartition("\n")[0] + (
        "\nimport robot_dyn, importlib.util\nassert importlib.util.find_spec('scipy') is None\n"
        "try:\n    import scipy\nexcept ImportError as error:\n    print(type(error).__name__)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["ModuleNotFoundError"]
