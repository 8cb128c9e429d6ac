"""Benchmarks, both sides in one run: medians over repeats that take turns. Only ratios of one run count.

Subjects: queries (Robot over bare Pinocchio), first (the first run of a process), compiled (against Pinocchio's C++),
rollouts (against MuJoCo), steps (with an action per lane, over rollouts), parameters (numbers as inputs of machine code
over constants), growth (cost against the number of joints), iftomm (problems A01 and A05 of the IFToMM library of
multibody benchmarks), stiff (joints with stiff dampers and springs), sticking (time stepping of dry friction and stops
against the event-driven limit, beside MuJoCo), precision (time against error, all methods beside SciPy, MuJoCo, Drake
and heyoka), limits (position limits on and off, beside MuJoCo), energy (of a long run), estimates (of errors, beside
true ones), proofs (radius and time of proven runs), plans (of motions: beside ruckig, paths at their limits, poses
reached, beside pin-pink), sweeps (coverage of the intervals of each design). What accuracy costs in other scenes:
work_precision.py.
"""

from __future__ import annotations

from collections.abc import Callable

from benchmarks import (
    energy,
    estimates,
    first_run,
    growth,
    iftomm,
    kernels,
    limits,
    parameters,
    pendulum_sweeps,
    plans,
    precision,
    proofs,
    queries,
    rollouts,
    steps,
    sticking,
    stiff,
    sweeps,
)
from benchmarks.measure import Effort, command_line

from robot_dyn.report.environment import processor_and_versions

SUBJECTS: dict[str, tuple[Callable[[Effort], None], ...]] = {
    "queries": (queries.queries, queries.lagrangian, queries.startup),
    "first": (first_run.first_run,),
    "compiled": (kernels.kernels, kernels.from_python, kernels.threads, kernels.first_use),
    "rollouts": (rollouts.one_step, rollouts.thousands, rollouts.sticking),
    "steps": (steps.steps, steps.kinematics),
    "parameters": (parameters.parameters,),
    "growth": (growth.growth, growth.memory),
    "iftomm": (iftomm.iftomm,),
    "stiff": (stiff.stiff,),
    "sticking": (sticking.sticking,),
    "precision": (precision.precision,),
    "limits": (limits.limits,),
    "energy": (energy.energy,),
    "estimates": (estimates.estimates,),
    "proofs": (proofs.proofs,),
    "plans": (plans.point_to_point, plans.paths, plans.poses, plans.poses_beside_pink),
    "sweeps": (sweeps.coverage, sweeps.indices, sweeps.costs, pendulum_sweeps.pendulum),
}


def main() -> None:
    parser = command_line(__doc__, "short loops: to see that it runs, not for figures")
    parser.add_argument("what", nargs="*", help=f"of {', '.join(SUBJECTS)}; all unless given")
    options = parser.parse_args()
    if unknown := set(options.what) - set(SUBJECTS):
        parser.error(f"no subject {', '.join(sorted(unknown))}; there are {', '.join(SUBJECTS)}")
    effort = Effort(2, 0.002) if options.quick else Effort()
    print(", ".join(f"{name} {value}" for name, value in processor_and_versions().items()))
    for subject in options.what or SUBJECTS:
        for measure in SUBJECTS[subject]:
            measure(effort)


if __name__ == "__main__":
    main()
