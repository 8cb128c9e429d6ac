"""The families of hard cases, in the order of the report."""

from __future__ import annotations

from typing import cast

from tests.hard import conditioning, far_out, tools
from tests.hard.case import Family

FAMILIES: dict[str, Family] = {
    each.__name__.rpartition(".")[2]: cast("Family", each) for each in (conditioning, far_out, tools)
}
