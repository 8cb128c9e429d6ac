"""Results as arrays and texts in files, and their comparison.

    |new − old| ≤ MAX_RATIO (growth + ε max(1, |old|))    for each quantity, at all samples

The growth of a quantity is measured when it is stored: the largest change that a start, or a design, makes which is
UNITS of rounding away. So it includes what the motion, its events and its controller make of rounding.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from referee import library as lib
from referee.library import Texts, Values
from referee.runs import Case

UNITS, PUSHES = 8, (1.0, -1.0)
MAX_RATIO = 100.0  # some thousand steps round, in trees that sum in other orders, where a push is a few roundings
COUNTS = ("steps", "evaluations", "evaluations of companions")  # may be those of a pushed run


@dataclass
class Result:
    """Numbers and texts of a case, and how much pushed runs of it differ.

    Attributes:
        values: Arrays by name.
        texts: Texts, counts and truth values by name.
        growth: Largest change of each array in a pushed run; inf where its shape changes.
        counts: Counts of the run and of its pushed runs.
    """

    values: Values
    texts: Texts
    growth: dict[str, float] = field(default_factory=dict)
    counts: dict[str, list[Any]] = field(default_factory=dict)


def with_growth(base: tuple[Values, Texts], pushed: Iterable[tuple[Values, Texts]]) -> Result:
    """Return a result with what its pushed runs differ by."""
    values, texts = base
    result = Result(
        values, texts, dict.fromkeys(values, 0.0), {name: [texts[name]] for name in COUNTS if name in texts}
    )
    for other, other_texts in pushed:
        for name, x in values.items():
            result.growth[name] = max(result.growth[name], distance(x, other.get(name)))
        for name, counts in result.counts.items():
            counts.append(other_texts[name])
    return result


def distance(x: np.ndarray, y: np.ndarray | None) -> float:
    """Return the largest difference of two arrays; inf where shapes or missing numbers differ."""
    if y is None or x.shape != y.shape or (np.isnan(x) != np.isnan(y)).any():
        return np.inf
    with np.errstate(invalid="ignore"):
        apart = np.where((x == y) | np.isnan(x), 0.0, np.abs(x - y))
    return float(apart.max(initial=0.0))


def size(x: np.ndarray) -> float:
    """Return the largest absolute value of an array, at least 1."""
    finite = np.abs(x[np.isfinite(x)])
    return float(finite.max(initial=1.0))


def run_case(case: Case, pushes: bool = True) -> Result:
    """Run a case, and with pushes twice again with starts that are UNITS of rounding away."""
    signs = np.where(np.arange(len(lib.start_of(case.setup)[0])) % 2, 1.0, -1.0) * UNITS * np.spacing(1.0)

    def made(push: float) -> tuple[Values, Texts]:
        if case.is_batch:
            runs = lib.rollouts(case.setup, case.q0 + push * signs, case.v0 + push * signs, case.vary, case.record)
            return lib.rollouts_values(runs)
        if push == 0.0:
            return lib.run_values(lib.simulate(case.setup))
        q0, v0 = lib.start_of(case.setup)
        return lib.run_values(lib.simulate(case.setup, q0 + push * signs, v0 + push * signs))

    return with_growth(made(0.0), map(made, PUSHES if pushes else ()))


def save(results: Mapping[str, Result], folder: Path, name: str) -> None:
    """Write results as an npz file of arrays and a JSON file of the rest."""
    folder.mkdir(parents=True, exist_ok=True)
    arrays = {f"{case}|{key}": x for case, result in results.items() for key, x in result.values.items()}
    np.savez_compressed(folder / f"{name}.npz", **arrays)  # pyright: ignore[reportArgumentType]
    rest = {
        case: {"texts": result.texts, "growth": result.growth, "counts": result.counts}
        for case, result in results.items()
    }
    (folder / f"{name}.json").write_text(json.dumps(rest, indent=1, ensure_ascii=False), encoding="utf-8")


def load(folder: Path, name: str) -> dict[str, Result]:
    """Read results that `save` wrote."""
    rest = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    results = {case: Result({}, x["texts"], x["growth"], x["counts"]) for case, x in rest.items()}
    with np.load(folder / f"{name}.npz") as arrays:
        for key in arrays.files:
            case, _, quantity = key.partition("|")
            results[case].values[quantity] = arrays[key]
    return results


@dataclass(frozen=True)
class Comparison:
    """How far a case is from the stored one.

    Attributes:
        case: Its name.
        difference: Largest difference of a quantity over its size.
        ratio: Largest difference over growth and rounding.
        quantity: The quantity with the largest ratio.
        faults: What differs otherwise, or by more than is allowed.
        is_same: Whether all numbers have the same bits.
    """

    case: str
    difference: float
    ratio: float
    quantity: str
    faults: tuple[str, ...]
    is_same: bool


def compared(case: str, old: Result, new: Result) -> Comparison:
    """Compare a result with the stored one."""
    texts = json.loads(json.dumps(new.texts))  # tuples and lists are alike
    faults = [f"{name}: missing" for name in sorted(old.values.keys() - new.values.keys())]
    faults += [f"{name}: new" for name in sorted(new.values.keys() - old.values.keys())]
    for name in old.texts.keys() | texts.keys():
        before, after = old.texts.get(name), texts.get(name)
        if name == "method" and before is not None:
            before = lib.RENAMED.get(before, before)
        allowed = old.counts.get(name, [before])
        if not (before == after or (name in COUNTS and is_between(after, allowed))):
            faults.append(f"{name}: {after} for {before}")
    worst, difference, quantity, is_same = 0.0, 0.0, "", True
    for name in sorted(old.values.keys() & new.values.keys()):
        x, y = old.values[name], new.values[name]
        is_same = is_same and x.tobytes() == y.tobytes()
        apart, grown = distance(x, y), old.growth[name]
        if apart == 0.0 or (np.isinf(grown) and np.isinf(apart)):
            continue
        ratio = apart / (grown + np.spacing(size(x)))
        difference = max(difference, apart / size(x))
        if ratio > MAX_RATIO:
            faults.append(f"{name}: differs by {apart:.3g}, {ratio:.3g} times growth and rounding")
        if ratio > worst:
            worst, quantity = ratio, name
    return Comparison(case, difference, worst, quantity, tuple(faults), is_same and not faults)


def is_between(x: Any, others: list[Any]) -> bool:
    """Return whether each count is at most as far from those of the run and its pushed runs as these are apart."""
    rows = np.array(others, float)
    low, high = rows.min(axis=0), rows.max(axis=0)
    return rows.shape[1:] == np.shape(x) and bool(((2 * low - high <= x) & (x <= 2 * high - low)).all())


def compare(name: str, old: Mapping[str, Result], compute: Callable[[str], Result]) -> list[Comparison]:
    """Compute each stored case again, and print a line for each."""
    print(f"\n| {name} | difference / size | / growth and rounding | largest in | same bits | faults |")
    print("|---|--:|--:|---|---|---|")
    rows = []
    for case, result in old.items():
        try:
            row = compared(case, result, compute(case))
        except Exception as error:  # a case that cannot be computed is a fault of the tree
            row = Comparison(case, np.inf, np.inf, "", (f"{type(error).__name__}: {error}",), False)
        rows.append(row)
        bits = "yes" if row.is_same else "no"
        print(
            f"| {case} | {row.difference:.1e} | {row.ratio:.2g} | {row.quantity} | {bits} | {'; '.join(row.faults)} |",
            flush=True,
        )
    return rows
