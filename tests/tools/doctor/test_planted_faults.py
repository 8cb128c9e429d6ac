"""Faults planted one at a time in sound arms of the catalog are found at their link or joint."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks import planted_faults
from lxml import etree

from robot_dyn.tools.doctor.checkup import checked
from tests.broken_files import SOUND

UNSEEN = {"mass × 10", "mesh in mm"}  # without meshes; a box of ten times its mass may be of steel


@pytest.mark.parametrize("fault", [name for name in planted_faults.FAULTS if name not in UNSEEN])
def test_a_planted_fault_is_found_where_it_is(fault: str) -> None:
    before = checked(SOUND.encode(), "rig.urdf")
    planted = planted_faults.planted(etree.fromstring(SOUND.encode()), fault, np.random.default_rng(0))
    assert planted is not None and not before.findings
    text, where = planted
    assert where in {each.where for each in checked(text, "rig.urdf").findings}
