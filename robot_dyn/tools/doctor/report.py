"""Findings as text: one line for each kind, with their number and the first three places."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from robot_dyn.tools.doctor.finding import Finding, Severity

_PLACES = 3


def grouped(findings: Iterable[Finding]) -> Iterator[tuple[Finding, ...]]:
    """Yield the findings of each severity and kind together, in order of first occurrence."""
    groups: dict[tuple[Severity, str], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.severity, finding.kind), []).append(finding)
    yield from map(tuple, groups.values())


def sentence(findings: tuple[Finding, ...]) -> str:
    """Return findings of one kind in one line: one finding in full; several with their places and the first text."""
    first = findings[0]
    if len(findings) == 1:
        return f"{first.severity.value}: {first.kind}: {first}"
    places = list(dict.fromkeys(finding.place for finding in findings))
    more = ", …" if len(places) > _PLACES else ""
    listed = ", ".join(places[:_PLACES])
    return (
        f"{first.severity.value}: {first.kind}, {len(findings)} times: {listed}{more}; {first.message}; {first.remedy}"
    )


def counted(findings: Iterable[Finding]) -> str:
    """Return the number of findings of each severity, such as "1 error, 2 notes"; empty for none."""
    severities = [finding.severity for finding in findings]
    counts = [(severities.count(severity), severity.value) for severity in Severity]
    return ", ".join(f"{count} {name}{'s' * (count > 1)}" for count, name in counts if count)
