"""The families of hard cases, in the order of the report."""

from __future__ import annotations

from typing import cast

from tests.campaigns.hard import (
    chaos,
    conditioning,
    contact,
    far_out,
    long_runs,
    nonsmooth_tutorials,
    peer_runs,
    peers,
    sampled_control,
    singularity,
    stiffness,
    tools,
    world,
)
from tests.campaigns.hard.case import Family

_ALL = (
    conditioning, far_out, long_runs, stiffness, contact, nonsmooth_tutorials, singularity, sampled_control, chaos,
    tools, world, peers, peer_runs,
)  # fmt: skip
FAMILIES: dict[str, Family] = {each.__name__.rpartition(".")[2]: cast("Family", each) for each in _ALL}
