"""Sensitivity: Ishigami's indices in closed form; SALib and SciPy as referees."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from SALib.analyze import pawn, sobol
from scipy.stats import randint, spearmanr

from robot_dyn.foundations import SweepError
from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps import designs, sensitivity
from tests.tools.sweeps.swept import of_figure

NAMES = ("x1", "x2", "x3")
PROBLEM = {"num_vars": 3, "names": list(NAMES), "bounds": [[0.0, 1.0]] * 3}


def ishigami(u: np.ndarray) -> np.ndarray:
    x = pi * (2 * u - 1)
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


# Closed form: Ishigami, Homma, An importance quantification technique, ISUMA 1990.
V1, V2, V13 = (1 + 0.1 * pi**4 / 5) ** 2 / 2, 49 / 8, 0.01 * pi**8 * (1 / 18 - 1 / 50)
FIRST = np.array([V1, V2, 0.0]) / (V1 + V2 + V13)
TOTAL = np.array([V1 + V13, V2, V13]) / (V1 + V2 + V13)


def runs(name: str, count: int, seed: int = 2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of a design, Ishigami's function of them, and their scramblings."""
    design = designs.design(name, count, 3, seed)
    return design.rows, ishigami(design.rows), design.scrambling


def saltelli(y: np.ndarray, scrambling: np.ndarray, known: Any = None) -> sw.Sensitivity:
    return sensitivity.saltelli(y, np.isfinite(y) if known is None else known, NAMES, scrambling)


def estimates(indices: Any) -> np.ndarray:
    return np.array([each.estimate for each in indices])


def test_saltelli_gives_ishigamis_indices() -> None:
    """Within 1.5 half-widths of the intervals, 3.2 standard errors, which are small at 40 960 runs."""
    _, y, scrambling = runs("saltelli", 16 * 5 * 512)
    made = saltelli(y, scrambling)
    for indices, true in ((made.first, FIRST), (made.total, TOTAL)):
        for each, x in zip(indices, true, strict=True):
            assert abs(each.estimate - x) < 1.5 * (each.high - each.low) / 2 < 0.05


def test_an_additive_function_has_equal_first_and_total_indices() -> None:
    """Variances of 1, 4, 9 of a sum: indices of 1/14, 4/14, 9/14."""
    u, _, scrambling = runs("saltelli", 16 * 5 * 64, 4)
    made = saltelli((u - 0.5) @ [1.0, 2.0, 3.0], scrambling)
    for indices in (made.first, made.total):
        for each, x in zip(indices, np.array([1, 4, 9]) / 14, strict=True):
            assert abs(each.estimate - x) < 1.5 * (each.high - each.low) / 2 < 0.05


def test_intervals_of_sobol_indices_hold_them_as_often_as_they_say() -> None:
    """Of 600 intervals of 95 %; those of one seed depend on each other, 5 σ of 100 independent ones is 11 %."""
    held = []
    for seed in range(100):
        _, y, scrambling = runs("saltelli", 16 * 5 * 16, seed)
        made = saltelli(y, scrambling)
        pairs = zip((*made.first, *made.total), (*FIRST, *TOTAL), strict=True)
        held.append([each.low <= x <= each.high for each, x in pairs])
    assert 0.84 < np.mean(held) < 1


def test_blocks_with_a_failed_run_are_left_out_and_counted() -> None:
    _, y, scrambling = runs("saltelli", 16 * 5 * 64)
    failed = y.copy()
    failed[[3, 7, 100]] = np.nan  # of blocks 0, 1 and 20
    made = saltelli(failed, scrambling)
    kept = np.delete(np.arange(16 * 64), [0, 1, 20])
    of_salib = sobol.analyze(PROBLEM, y.reshape(-1, 5)[kept].ravel(), calc_second_order=False, seed=1)
    np.testing.assert_allclose(estimates(made.first), of_salib["S1"], atol=1e-12)
    np.testing.assert_allclose(estimates(made.total), of_salib["ST"], atol=1e-12)
    assert made.left_out == 3


def test_sobol_indices_do_not_depend_on_unit_and_origin() -> None:
    _, y, scrambling = runs("saltelli", 16 * 5 * 16)
    one, other = saltelli(y, scrambling), saltelli(1e6 + 3 * y, scrambling)
    np.testing.assert_allclose(estimates(other.total + other.first), estimates(one.total + one.first), atol=1e-8)


def test_pawn_indices_are_those_of_salib_and_the_correlation_is_spearmans() -> None:
    """SALib takes F at one value less of each bin."""
    u, y, _ = runs("random", 2048)
    made = sensitivity.by_values(y, u, NAMES)
    np.testing.assert_allclose(made.pawn, pawn.analyze(PROBLEM, u, y, S=32, seed=1)["median"], atol=0.02)
    assert made.rank_correlation == pytest.approx([spearmanr(x, y)[0] for x in u.T])


def test_pawn_sees_influence_that_the_rank_correlation_does_not_and_says_what_noise_gives() -> None:
    """The third parameter of Ishigami's function acts by interaction alone."""
    u, y, _ = runs("random", 2**14)
    inert = np.random.default_rng(8).random((len(y), 1))
    made = sensitivity.by_values(y, np.hstack([u, inert]), (*NAMES, "inert"))
    assert abs(made.rank_correlation[2]) < 0.03 < made.rank_correlation[0]
    assert made.pawn[2] > 1.5 * made.pawn_noise
    assert made.pawn[3] == pytest.approx(made.pawn_noise, rel=0.3)  # both are chance


def test_sensitivity_by_values_does_not_depend_on_unit_and_scale() -> None:
    u, y, _ = runs("random", 1024)
    one, other = (sensitivity.by_values(a, b, NAMES) for a, b in ((y, u), (1e6 + 3 * y, np.exp(9 * u))))
    assert other.rank_correlation == pytest.approx(one.rank_correlation) and other.pawn == pytest.approx(one.pawn)


Y, U = np.arange(160.0), np.random.default_rng(1).random((160, 3))
WRONG: dict[str, Callable[[], Any]] = {
    "need runs of 3 scramblings or more, got 1": lambda: saltelli(Y, np.zeros(160, int)),
    "is the same in all runs": lambda: sensitivity.by_values(0 * Y, U, NAMES),
    "level must be below 1": lambda: sensitivity.saltelli(Y, Y > 0, NAMES, np.arange(160), 95),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_has_no_sensitivity_is_refused(message: str) -> None:
    with pytest.raises(SweepError, match=message):
        WRONG[message]()


# --- of sweeps, whose figures are functions of what varies

TEN = {"choice": sw.choice(np.arange(1.0, 11.0)), "of scipy": randint(1, 11)}


@pytest.mark.parametrize("design", ["random", "sobol", "latin"])
@pytest.mark.parametrize("kind", TEN)
def test_a_discrete_parameter_that_decides_a_figure_is_seen_by_its_values(
    tmp_path: Path, kind: str, design: str
) -> None:
    """The parity of one of ten values: the distribution given a value is half a step from that of all."""
    found = of_figure(tmp_path, "parity", TEN[kind], design=design).sensitivity("f")
    assert found.names[:2] == ("kp", "kd")
    assert found.pawn[0] == pytest.approx(0.5, abs=0.1) and found.pawn[1] < 0.2
    assert abs(found.rank_correlation[0]) < 0.2 and found.first == found.total == ()


@pytest.mark.parametrize("design", ["random", "sobol", "latin"])
def test_a_sine_of_eight_periods_is_seen_and_has_no_monotone_part(tmp_path: Path, design: str) -> None:
    found = of_figure(tmp_path, "waves", sw.uniform(low=0.0, high=1.0), design=design, runs=2048).sensitivity("f")
    assert abs(found.rank_correlation[0]) < 0.15 < found.pawn[0] - found.pawn_noise


def test_saltelli_has_the_index_of_a_sine_of_eight_periods_in_the_interval(tmp_path: Path) -> None:
    """sin(16 π x₁) + x₂ − 1/2: S₁ = (1/2) / (1/2 + 1/12) = 6/7."""
    done = of_figure(tmp_path, "waves", sw.uniform(low=0.0, high=1.0), design="saltelli", runs=4096)
    kp, _ = done.sensitivity("f").first
    assert kp.low <= 6 / 7 <= kp.high and kp.high - kp.low < 0.2


def test_the_report_shows_failures_over_the_parameter_that_decides_them(tmp_path: Path) -> None:
    """Runs fail by the parity of one of 64 values; three other numbers that vary do not matter."""
    vary = {"q0": sw.normal(mean=[0.4, 0.9], sd=0.1)}
    done = of_figure(tmp_path, "fails", sw.choice(np.arange(64.0)), design="sobol", vary=vary)
    page = done.save(tmp_path / "report.html").read_text(encoding="utf-8")
    shown = re.search(r"failed runs over (\S+) and (\S+),", page)
    assert shown is not None and "kp" in shown.groups()
