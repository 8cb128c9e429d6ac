"""True digits of M, C, N, inverse and forward dynamics of many robots: the tables of docs/accuracy.md.

Each is `rd.certify`. With --keep FILE what is found stays there, a line of JSON each, and a later call goes on.
"""

from __future__ import annotations

import argparse
import json
import warnings
from pathlib import Path
from typing import Any

import robot_dyn as rd
from robot_dyn.result import plain

MOST_JOINTS = 12
IMPLEMENTATIONS = (
    "Pinocchio", "Lagrangian, float32", "Lagrangian, float64", "Lagrangian, longdouble", "articulated body",
    "machine code",
)  # fmt: skip
FORWARD = "forward_dynamics"
Document = dict[str, Any]


def arms() -> list[str]:
    """Robots of the catalog with no more joints than that."""
    found = []
    for name in rd.list_robots():
        try:
            found += [name] * (rd.load(name).n <= MOST_JOINTS)
        except rd.RobotDynError as error:
            print(f"{name}: {error}")
    return found


def digits(made: Document, quantity: str, implementation: str) -> tuple[float, float] | None:
    """At the worst of the random states, and at the worst that was found."""
    found = [
        each for each in made["digits"] if (each["quantity"], each["implementation"]) == (quantity, implementation)
    ]
    return (found[0]["random"], found[0]["searched"]) if found else None


def of_robots(documents: dict[str, Document]) -> None:
    """A row for each robot: κ, and digits of forward dynamics."""
    print(f"\n| robot | joints | κ, typical | κ, searched | {' | '.join(IMPLEMENTATIONS)} | decimals |")
    print("|---|--:|--:|--:|" + "--:|" * (len(IMPLEMENTATIONS) + 1))
    for name, made in sorted(documents.items(), key=lambda each: (len(each[1]["joints"]), each[0])):
        found = [digits(made, FORWARD, implementation) for implementation in IMPLEMENTATIONS]
        cells = ["—" if each is None else f"{each[0]:.1f} → {each[1]:.1f}" for each in found]
        of, decimals = made["condition"], made["decimals"].get(FORWARD)
        kappa = [f"{of[key]:.3g}" if of[key] and of[key] < 1e15 else "∞" for key in ("typical", "searched")]
        print(f"| {name} | {len(made['joints'])} | {' | '.join(kappa)} | {' | '.join(cells)} | "
              f"{'—' if decimals is None else f'{decimals:.1f}'} |")  # fmt: skip


def of_quantities(documents: dict[str, Document]) -> None:
    """A row for each quantity and implementation: the fewest digits of all robots."""
    print("\n| quantity | implementation | median of typical | worst random | searched | robot | worse than random |")
    print("|---|---|--:|--:|--:|---|--:|")
    for quantity in ("M", "C", "N", "inverse_dynamics", FORWARD):
        for implementation in IMPLEMENTATIONS:
            found = {name: each for name, made in documents.items() if (each := digits(made, quantity, implementation))}
            if found:
                name = min(found, key=lambda name: found[name][1])
                typical = sorted(
                    each["typical"] for made in documents.values() for each in made["digits"]
                    if (each["quantity"], each["implementation"]) == (quantity, implementation)
                )  # fmt: skip
                worse = sum(searched < random for random, searched in found.values())
                median, at_random = typical[len(typical) // 2], min(x for x, _ in found.values())
                print(f"| {quantity} | {implementation} | {median:.1f} | {at_random:.1f} | {found[name][1]:.1f}"
                      f" | {name} | {worse} of {len(found)} |")  # fmt: skip


if __name__ == "__main__":
    warnings.simplefilter("ignore", rd.ModelWarning)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", nargs="*", help=f"names; all with up to {MOST_JOINTS} joints if none")
    parser.add_argument("--quick", action="store_true", help="one robot and 100 states: to see that it works")
    parser.add_argument("--keep", type=Path, help="file of what is found, a line for each robot")
    options = parser.parse_args()
    lines = options.keep.read_text().splitlines() if options.keep and options.keep.exists() else []
    documents: dict[str, Document] = {made["name"]: made for made in map(json.loads, lines)}
    for name in ["planar_2r"] if options.quick else options.robots or arms():
        if name in documents:
            continue
        made = rd.certify(rd.load(name), samples=100, repeats=1) if options.quick else rd.certify(rd.load(name))
        documents[name] = {"name": name} | plain(made)
        if options.keep:
            with options.keep.open("a") as file:
                file.write(json.dumps(documents[name]) + "\n")
    of_quantities(documents)
    of_robots(documents)
