"""The members of a run file: the arrays of a trajectory, with the shape and type that each must have."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, final

from robot_dyn.errors import shorten
from robot_dyn.simulation.results.archive import ArchiveError, Header


@final
@dataclass(frozen=True)
class Member:
    """An array of a run file.

    Attributes:
        shape: A number; a letter, which stands for the same length in all members (m samples, n joints); None for any
            length; or several of these, each of which is allowed.
        dtype: Of its entries.
        finite: Whether nan and inf are refused unless the run diverged.
        absent: Whether all of it may be nan: what a run of rollouts did not record.
    """

    shape: tuple[Any, ...]
    dtype: str = "float64"
    finite: bool = True
    absent: bool = False


# Paths of the fields of a Trajectory; `/*` stands for one array under each name.
MEMBERS: Mapping[str, Member] = MappingProxyType(
    {
        "t": Member(("m",)),
        "q": Member(("m", "n")),
        "v": Member(("m", "n")),
        "a": Member(("m", "n"), absent=True),
        "u": Member(("m", "n"), absent=True),
        "power/*": Member(("m",), absent=True),
        "ledger/kinetic": Member(("m",), absent=True),
        "ledger/potential": Member(("m",), absent=True),
        "ledger/work/*": Member(("m",), absent=True),
        "ledger/stored/*": Member(("m",)),
        "desired": Member(("m", "n")),
        "controller_states": Member(("m", "z")),
        "effect_states/*": Member(("m", None)),
        "deviation": Member(("m", ("n", 3))),
        "at_stop": Member(("m", "n"), "bool"),
        "wrenches/*": Member((None, 7)),
        "extremes": Member((3, 2, "n"), finite=False),
        "error/t": Member(("k",)),
        "error/error": Member(("k",), finite=False),
    }
)


# Paths of the fields of Rollouts; of runs that ended early the rest is nan.
OF_ROLLOUTS: Mapping[str, Member] = MappingProxyType(
    {
        "t": Member(("m",)),
        "q": Member(("B", "m", "n"), finite=False),
        "v": Member(("B", "m", "n"), finite=False),
        "u": Member(("B", "m", "n"), finite=False),
        "kinetic": Member(("B", "m"), finite=False),
        "potential": Member(("B", "m"), finite=False),
        "work/*": Member(("B", "m"), finite=False),
        "ended": Member(("B",)),
        "diverged": Member(("B",), "bool"),
        "stopped": Member(("B",), "bool"),
        "steps": Member(("B",), "int64"),
        "evaluations": Member(("B",), "int64"),
        "params/*": Member(("B", None)),
        "q0": Member(("B", "n")),
        "v0": Member(("B", "n")),
        "observed/extremes": Member(("B", 3, 2, "n"), finite=False),
        "observed/instants": Member(("B",), "int64"),
        "observed/limits": Member(("B", "L"), finite=False),
        "observed/visits": Member(("B", "L", 4), finite=False),
        "observed/episodes": Member(("B", "n", 3)),
        "saved/tracking_error": Member(("B",), finite=False),
    }
)


def member(name: str, members: Mapping[str, Member] = MEMBERS) -> Member:
    """What is known of a member; ArchiveError if nothing is."""
    groups = [known for known in members if known.endswith("/*") and name.startswith(known[:-1])]
    for known in (name, *groups):
        with suppress(KeyError):
            return members[known]
    raise ArchiveError(f"member {shorten(name)!r} is not known to this version")


def check_headers(
    headers: Mapping[str, Header], about: dict[str, Any], members: Mapping[str, Member] = MEMBERS
) -> None:
    """Every array has the type and shape of its member, and letters of shapes stand for one length."""
    joint_names = about.get("joint_names")
    lengths: dict[Any, int] = {"n": len(joint_names) if isinstance(joint_names, list) else 0}
    for name, header in headers.items():
        if name in ("about", "sha256"):
            continue
        known = member(name, members)
        fits = len(header.shape) == len(known.shape) and header.dtype == known.dtype
        if not fits or not all(_fits(*pair, lengths) for pair in zip(header.shape, known.shape, strict=True)):
            shape = ", ".join(f"{each} = {lengths[each]}" if each in lengths else str(each) for each in known.shape)
            raise ArchiveError(f"member {shorten(name)!r} holds {header}, not {known.dtype} ({shape})")


def _fits(length: int, asked: Any, lengths: dict[Any, int]) -> bool:
    if isinstance(asked, tuple):
        return any(_fits(length, each, lengths) for each in asked)
    if isinstance(asked, str):
        return lengths.setdefault(asked, length) == length
    return asked in (None, length)
