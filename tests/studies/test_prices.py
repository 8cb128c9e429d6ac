"""Prices in words: what an error takes by each program, with what was not reached, and why."""

from __future__ import annotations

from robot_dyn.cli import studies
from robot_dyn.studies.work_precision_diagram.tolerance_ladder import ToleranceLadder
from tests.studies.test_work_precision import invented, points


def test_each_program_is_named_with_its_cheapest_method_or_with_what_ended_it() -> None:
    def ladder(
        name: str, *errors: float, engine: str = "", each_s: float = 1e-3, ended: str = "late"
    ) -> ToleranceLadder:
        return ToleranceLadder(name, engine, True, 4, "step", points(*errors, each_s=each_s), ended, 1e-12)

    own = ladder("DOP853", 1e-6, 1e-8, engine="compiled"), ladder("rk4", 1e-2, 1e-8, engine="compiled", each_s=1.0)
    other = ladder("Other RK4", 1e-4, 1e-8, each_s=0.1), ladder("Other Euler", 1.0, 0.5)
    more = ladder("Third RK", 2.0, 1.0), ladder("Fourth RK", 1e-8)
    assert list(studies.programs(invented(*other, *own, *more), 1e-8)) == [
        "  robot_dyn DOP853: 2 ms", "  Fourth RK: 1 ms, 0.5 times as long", "  Other RK4: 200 ms, 100 times as long",
        "  Third: reached by no run (late)", "  times of the loop alone, medians of runs that take turns",
    ]  # fmt: skip
    lost = list(studies.programs(invented(ladder("DOP853", 2.0, 1.0, engine="compiled"), *other), 1e-8))
    assert lost[:2] == ["  robot_dyn: reached by no run (late)", "  Other RK4: 200 ms"]
