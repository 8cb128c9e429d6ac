"""Findings as text: one line a kind, with their number and the first three places."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from robot_dyn.tools.doctor.finding import Finding, Severity

_PLACES = 3


def grouped(findings: Iterable[Finding]) -> Iterator[tuple[Finding, ...]]:
    """The findings of one severity and kind together, in the order of the first of each."""
    groups: dict[tuple[Severity, str], list[Finding]] = {}
    for each in findings:
        groups.setdefault((each.severity, each.kind), []).append(each)
    yield from map(tuple, groups.values())


def sentence(findings: tuple[Finding, ...]) -> str:
    """Findings of one kind in one line: a single one after its kind; of several the places, and what the first says."""
    first = findings[0]
    if len(findings) == 1:
        return f"{first.severity.value}: {first.kind}: {first}"
    places = list(dict.fromkeys(each.place for each in findings))
    more = ", …" if len(places) > _PLACES else ""
    listed = ", ".join(places[:_PLACES])
    return f"{first.severity.value}: {first.kind}, {len(findings)} times: {listed}{more}; {first.what}; {first.remedy}"


def counted(findings: Iterable[Finding]) -> str:
    """How many of each severity there are, such as "1 error, 2 notes"; empty for none."""
    severities = [each.severity for each in findings]
    counts = [(severities.count(each), each.value) for each in Severity]
    return ", ".join(f"{count} {name}{'s' * (count > 1)}" for count, name in counts if count)
