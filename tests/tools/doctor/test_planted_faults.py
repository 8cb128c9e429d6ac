"""Faults planted one at a time in sound arms of the catalog are found at their link or joint."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks import planted_faults
from lxml import etree

from robot_dyn.tools.doctor import checked
from tests.broken_files import SOUND
from tests.long import long

UNSEEN = {"mass × 10", "mesh in mm"}  # without meshes; a box of ten times its mass may be of steel


@pytest.mark.parametrize("fault", [name for name in planted_faults.FAULTS if name not in UNSEEN])
def test_a_planted_fault_is_found_where_it_is(fault: str) -> None:
    before = checked(SOUND.encode(), "rig.urdf")
    planted = planted_faults.planted(etree.fromstring(SOUND.encode()), fault, np.random.default_rng(0))
    assert planted is not None and not before.findings
    text, where = planted
    assert where in {each.where for each in checked(text, "rig.urdf").findings}


@pytest.mark.parametrize("units", [True, *long([False])])
def test_repairing_a_repaired_file_changes_no_byte_and_left_is_what_a_new_check_finds(units: bool) -> None:
    """Each planted fault alone, and pairs of them."""
    root, rng = etree.fromstring(SOUND.encode()), np.random.default_rng(7)
    names = [name for name in planted_faults.FAULTS if name != "mesh in mm"]
    single = {name: planted_faults.planted(root, name, rng) for name in names}
    texts = {name: faulty[0] for name, faulty in single.items() if faulty is not None}
    for chosen in (("limits in degrees", "limits crossed"), *(tuple(rng.choice(names, 2)) for _ in range(15))):
        if (text := planted_faults.pair(root, chosen, rng)) is not None:
            texts[" + ".join(chosen)] = text
    assert len(texts) > 25
    broken = {name: planted_faults.unlike(text, "rig.urdf", units) for name, text in texts.items()}
    assert not any(broken.values()), broken
