"""True digits of M, C, N, inverse and forward dynamics of many robots: the tables of docs/studies/certify.md.

Each is `rd.accuracy.certify`. With --keep FILE the results are stored there, a line of JSON each,
and a later call continues.
"""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

from benchmarks.measure import command_line

import robot_dyn as rd
from robot_dyn.foundations.result import plain

MAX_JOINTS = 12
IMPLEMENTATIONS = (
    "Pinocchio", "Lagrangian, float32", "Lagrangian, float64", "Lagrangian, longdouble", "articulated body",
    "machine code",
)  # fmt: skip
FORWARD = "forward_dynamics"
Document = dict[str, Any]  # of a certificate


def arms() -> list[str]:
    """Robots of the catalog with at most MAX_JOINTS joints."""
    names = []
    for name in rd.list_robots():
        try:
            names += [name] * (rd.load(name).n <= MAX_JOINTS)
        except rd.RobotDynError as error:
            print(f"{name}: {error}")
    return names


def digits(document: Document, quantity: str, implementation: str) -> Document | None:
    """The digits of a quantity by an implementation: typical, at the worst random state, and at the worst found."""
    entries = document["digits"]
    return next((x for x in entries if (x["quantity"], x["implementation"]) == (quantity, implementation)), None)


def of_robots(documents: dict[str, Document]) -> None:
    """A row for each robot: κ, and digits of forward dynamics."""
    print(f"\n| robot | joints | κ, typical | κ, searched | {' | '.join(IMPLEMENTATIONS)} | decimals |")
    print("|---|--:|--:|--:|" + "--:|" * (len(IMPLEMENTATIONS) + 1))
    for name, document in sorted(documents.items(), key=lambda item: (len(item[1]["joints"]), item[0])):
        entries = [digits(document, FORWARD, implementation) for implementation in IMPLEMENTATIONS]
        cells = ["—" if x is None else f"{x['random']:.1f} → {x['searched']:.1f}" for x in entries]
        condition, decimals = document["condition"], document["decimals"].get(FORWARD)
        kappa = [f"{x:.3g}" if (x := condition[key]) and x < 1e15 else "∞" for key in ("typical", "searched")]
        print(f"| {name} | {len(document['joints'])} | {' | '.join(kappa)} | {' | '.join(cells)} | "
              f"{'—' if decimals is None else f'{decimals:.1f}'} |")  # fmt: skip


def of_quantities(documents: dict[str, Document]) -> None:
    """A row for each quantity and implementation: the fewest digits of all robots."""
    print("\n| quantity | implementation | median of typical | worst random | searched | robot | worse than random |")
    print("|---|---|--:|--:|--:|---|--:|")
    for quantity in ("M", "C", "N", "inverse_dynamics", FORWARD):
        for implementation in IMPLEMENTATIONS:
            found = {name: x for name, each in documents.items() if (x := digits(each, quantity, implementation))}
            if found:
                worst = min(found, key=lambda name: found[name]["searched"])
                typical = sorted(x["typical"] for x in found.values())
                worse = sum(x["searched"] < x["random"] for x in found.values())
                median, at_random = typical[len(typical) // 2], min(x["random"] for x in found.values())
                print(f"| {quantity} | {implementation} | {median:.1f} | {at_random:.1f}"
                      f" | {found[worst]['searched']:.1f} | {worst} | {worse} of {len(found)} |")  # fmt: skip


if __name__ == "__main__":
    warnings.simplefilter("ignore", rd.ModelWarning)
    parser = command_line(__doc__, "one robot and 100 states: to see that it works")
    parser.add_argument("robots", nargs="*", help=f"names; all with up to {MAX_JOINTS} joints unless given")
    parser.add_argument("--keep", type=Path, help="file of results, a line for each robot; a later call continues it")
    options = parser.parse_args()
    lines = options.keep.read_text().splitlines() if options.keep and options.keep.exists() else []
    documents: dict[str, Document] = {document["name"]: document for document in map(json.loads, lines)}
    settings: dict[str, Any] = {"samples": 100, "repeats": 1} if options.quick else {}
    for name in ["planar_2r"] if options.quick else options.robots or arms():
        if name not in documents:
            documents[name] = {"name": name} | plain(rd.accuracy.certify(rd.load(name), **settings))
            if options.keep:
                with options.keep.open("a") as file:
                    file.write(json.dumps(documents[name]) + "\n")
    of_quantities(documents)
    of_robots(documents)
