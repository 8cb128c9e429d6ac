"""The table of queries: every engine answers each row, with one signature and one text."""

from __future__ import annotations

from functools import cache
from inspect import getdoc, signature
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.codegen import CompiledDynamics
from robot_dyn.foundations import OverflowedError, QueryError
from robot_dyn.lagrange.formulas import FORMULAS
from robot_dyn.model.calls import PINOCCHIO
from robot_dyn.queries import EQUATION, QUANTITIES, Dynamics
from tests.queries import arguments_of

ENGINES = (rd.Robot, rd.Lagrangian, CompiledDynamics)


@cache
def engine(kind: type, name: str = "planar_2r") -> Any:
    robot = rd.load(name)
    return robot if kind is rd.Robot else kind(robot)


def asked(kind: type, query: str, *state: Any, **options: Any) -> Any:
    frame = [engine(kind).joint_names[-1]] if QUANTITIES[query].framed else []
    return getattr(engine(kind), query)(*state, *frame, **options)


def test_pinocchios_calls_and_own_formulas_are_those_of_the_table() -> None:
    assert PINOCCHIO.keys() == FORMULAS.keys() == QUANTITIES.keys()


@pytest.mark.parametrize("kind", ENGINES)
def test_every_query_has_one_signature_and_one_text(kind: type) -> None:
    for name in QUANTITIES:
        ours, theirs = (signature(getattr(each, name)) for each in (kind, Dynamics))
        assert [str(x).partition(":")[0] for x in ours.parameters.values()] == [
            str(x).partition(":")[0] for x in theirs.parameters.values()
        ]
        assert getdoc(getattr(kind, name)) == getdoc(getattr(Dynamics, name))


@pytest.mark.parametrize("kind", ENGINES)
@pytest.mark.parametrize("query", QUANTITIES)
@pytest.mark.parametrize("batch", [(), (3,), (2, 10)])
def test_an_answer_has_the_shape_of_its_row_and_goes_into_out(query: str, kind: type, batch: tuple[int, ...]) -> None:
    state = arguments_of(query, 2, batch=batch)
    answer = asked(kind, query, *state)
    assert np.shape(answer) == (*batch, *QUANTITIES[query].shape(engine(rd.Robot).sizes))
    out = np.full(np.shape(answer), np.nan)
    assert asked(kind, query, *state, out=out) is out
    np.testing.assert_array_equal(out, answer)


@pytest.mark.parametrize("kind", ENGINES)
@pytest.mark.parametrize("query", QUANTITIES)
def test_out_is_left_as_it_was_where_a_query_raises(query: str, kind: type) -> None:
    state, shape = arguments_of(query, 2), QUANTITIES[query].shape(engine(rd.Robot).sizes)
    out, frozen = np.full(shape, 7.0), np.full(shape, 7.0)
    frozen.setflags(write=False)
    with pytest.raises(QueryError):
        asked(kind, query, *[np.full(2, np.nan)] * len(state), out=out)
    with pytest.raises((OverflowedError, QueryError)):
        asked(kind, query, *[np.full(2, np.inf)] * len(state), out=out)
    with pytest.raises(QueryError):
        asked(kind, query, *state, out=np.full((*shape, 5), 7.0))
    with pytest.raises(QueryError):
        asked(kind, query, *state, out=frozen)
    assert np.all(out == 7.0) and np.all(frozen == 7.0)


def test_machine_code_has_every_query_without_a_frame() -> None:
    compiled = engine(CompiledDynamics)
    for query in EQUATION:
        asked(CompiledDynamics, query, *arguments_of(query, 2))
    assert not [query for query in EQUATION if compiled.served_by(query) == "Pinocchio"]
    assert EQUATION.keys() <= compiled.instructions.keys()


def test_the_comparison_has_every_query_of_the_table() -> None:
    result = rd.compare(engine(rd.Robot), samples=2)
    assert result.ok, result.worst
    assert QUANTITIES.keys() <= result.quantities.keys()
