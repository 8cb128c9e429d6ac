"""Machine code for other processors: equal to rounding, and to the bit if it is portable."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from tests.codegen.targets import BUILDS, TARGETS, difference, forms, on_this_processor
from tests.tools.export.c_program import HOST

FORMS = forms("planar_2r")
# Makes some chunks of a sweep in a process whose machine code is for this processor or another.
PART = """import sys
from pathlib import Path
_, folder, out, part, name = sys.argv
if name:
    import llvmlite.binding as binding
    class Features:
        def flatten(self):
            return ""
    binding.get_host_cpu_name, binding.get_host_cpu_features = (lambda: name), Features
from robot_dyn.tools import sweeps as sw
from tests.tools.sweeps.swept import swept
sw.run(swept(Path(folder), 64), Path(folder) / out, threads=1, chunk=16, job=part)"""


@pytest.mark.long
@pytest.mark.parametrize("place", TARGETS)
def test_targets_agree_to_rounding_and_portable_code_to_the_bit(place: str, tmp_path) -> None:
    """Sums reordered and products contracted: some tens of units of rounding of the largest result."""
    build = BUILDS.get(place, HOST)
    if build.missing or HOST.missing:
        pytest.skip(f"not installed: {build.missing or HOST.missing}")
    if place != "aarch64" and not on_this_processor().features.count("+avx2"):
        pytest.skip("this processor has no AVX2")

    def values(form, target, build) -> np.ndarray:
        return form.values(form.built(target, build, tmp_path)[0], build)

    for name, form in FORMS.items():
        here = values(form, on_this_processor(), HOST)
        assert difference(values(form, TARGETS[place], build), here) < 100 * form.eps, name
        portable = values(form, on_this_processor(portable=True), HOST)
        np.testing.assert_array_equal(values(form, replace(TARGETS[place], portable=True), build), portable, name)
        assert difference(portable, here) < 100 * form.eps, name


@pytest.mark.long
def test_a_portable_sweep_of_two_processors_has_one_digest(tmp_path) -> None:
    """Half by code for this processor, half for one with SSE2 alone."""
    pytest.importorskip("pyarrow")
    from robot_dyn.tools import sweeps as sw

    def make(out: str, part: str, name: str) -> None:
        environment = os.environ | {
            "ROBOT_DYN_CACHE": str(tmp_path / "cache"),
            "ROBOT_DYN_PORTABLE": "1",
        }
        command = [sys.executable, "-c", PART, str(tmp_path), out, part, name]
        subprocess.run(command, env=environment, check=True, timeout=300)

    make("here", "1/1", "")
    make("mixed", "1/2", "")
    make("mixed", "2/2", "x86-64")
    here, mixed = (sw.read_sweep(tmp_path / out) for out in ("here", "mixed"))
    assert mixed.processors == {"portable": 4}
    assert here.verify() == mixed.verify()
