"""Benchmarks, both sides in one run: medians over repeats that take turns. Only ratios of one run count.

Subjects: queries (Robot over bare Pinocchio), first (the first run of a process), compiled (against Pinocchio's C++),
rollouts (against MuJoCo), parameters (numbers as inputs of machine code over constants), growth (cost against the
number of joints), iftomm (problems A01 and A05 of the IFToMM library of multibody benchmarks), stiff (joints with stiff
dampers and springs), sticking (time stepping of dry friction and stops against the event-driven limit, beside MuJoCo),
precision (time against error, all methods beside SciPy, MuJoCo, Drake and heyoka), energy (of a long run), estimates
(of errors, beside true ones), proofs (radius and time of proven runs). What accuracy costs in other scenes:
work_precision.py.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks import (
    energy,
    estimates,
    first_run,
    growth,
    iftomm,
    kernels,
    parameters,
    precision,
    proofs,
    queries,
    rollouts,
    sticking,
    stiff,
)
from benchmarks.measure import Effort

from robot_dyn.studies.environment import environment

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
SUBJECTS = (
    "queries", "first", "compiled", "rollouts", "parameters", "growth", "iftomm", "stiff", "sticking", "precision",
    "energy", "estimates", "proofs",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", help=f"of {', '.join(SUBJECTS)}; all if none")
    parser.add_argument("--quick", action="store_true", help="short loops: to see that it runs, not for figures")
    options = parser.parse_args()
    if unknown := set(options.what) - set(SUBJECTS):
        parser.error(f"no subject {', '.join(sorted(unknown))}; there are {', '.join(SUBJECTS)}")
    effort = Effort(2, 0.002) if options.quick else Effort()
    what = options.what or SUBJECTS
    print(", ".join(f"{name} {value}" for name, value in environment().items()))
    if "queries" in what:
        queries.queries(effort)
        queries.lagrangian(effort)
        queries.right_angles(effort)
        queries.startup(effort)
    if "first" in what:
        first_run.first_run(effort)
    if "compiled" in what:
        kernels.kernels(effort)
        kernels.from_python(effort)
        kernels.threads(effort)
        kernels.first_use(effort)
    if "rollouts" in what:
        rollouts.one_step(effort)
        rollouts.thousands(effort)
        rollouts.sticking(effort)
    if "parameters" in what:
        parameters.parameters(effort)
    if "growth" in what:
        growth.growth(effort, None if options.quick else PICTURES / "growth.png")
        growth.memory(effort)
    if "iftomm" in what:
        iftomm.iftomm(effort)
    if "stiff" in what:
        stiff.stiff(effort)
    if "sticking" in what:
        sticking.sticking(effort)
    if "precision" in what:
        precision.precision(effort, None if options.quick else PICTURES / "precision.png")
    if "energy" in what:
        energy.energy(effort)
    if "estimates" in what:
        estimates.estimates(effort)
    if "proofs" in what:
        proofs.proofs(effort, None if options.quick else PICTURES / "proofs.png")


if __name__ == "__main__":
    main()
