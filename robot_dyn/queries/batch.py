"""Batches: a query answers every state, or names the first that has no answer; errors="nan" answers the others.

A batch is evaluated as a whole. Only if that fails is it halved, until the states without an answer are found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from robot_dyn.foundations.arithmetic import FLOAT64, Arithmetic, Array
from robot_dyn.foundations.errors import (
    NotFiniteError,
    OverflowedError,
    QueryError,
    RobotDynError,
    SingularError,
    shown,
)
from robot_dyn.foundations.validate import check_batches, converted

_REFUSALS = (NotFiniteError, OverflowedError, SingularError)  # of a state; all else is wrong with the query


class DoubtError(RobotDynError):
    """Internal: some state of a batch must be evaluated by itself."""


def answered(
    equation: Callable[..., Array],
    arrays: Mapping[str, Array],
    shape: tuple[int, ...],
    joint_names: tuple[str, ...],
    errors: str = "raise",
    arithmetic: Arithmetic = FLOAT64,
) -> Array:
    """The answers to a batch of states, (..., *shape).

    Args:
        equation: (x₁, x₂, …) → answers, for one state (n,) or a batch; may raise SingularError or OverflowedError.
        arrays: Its arguments by name, each (..., n), or (..., 1) for the time t; floats and integers of any type.
        shape: Of the answer for one state.
        joint_names: For messages.
        errors: "raise", or "nan" to answer NaN where a state has no answer.
        arithmetic: Of arguments and answers.

    Raises:
        QueryError: If the batch axes do not match, or `errors` is neither; NotFiniteError if an argument is not finite.
        OverflowedError: If the answer of a state is not finite, or the arithmetic does not hold its q or t.
        SingularError: Where forward dynamics has no answer. In a batch each names the row.
    """
    if errors.__class__ is not str or errors not in ("raise", "nan"):
        raise QueryError(f"errors must be 'raise' or 'nan', got {shown(errors)}")
    batch = check_batches(**arrays)

    def attempt(*given: Array) -> Array:
        answer = equation(*(converted(*each, joint_names, arithmetic) for each in zip(arrays, given, strict=True)))
        if (
            isinstance(answer, np.ndarray) and answer.dtype == object
        ):  # entries that are 0 or 1 whatever the state are integers still
            answer = arithmetic.array(answer)
        if not arithmetic.finite(answer).all():
            raise OverflowedError(f"{', '.join(arrays)} are so large that the result overflows")
        return answer

    if 0 in batch:
        return np.zeros((*batch, *shape), dtype=arithmetic.dtype)
    with np.errstate(all="ignore"):  # overflow is reported by an error
        try:
            return attempt(*arrays.values())
        except (*_REFUSALS, DoubtError):
            if not batch and errors == "raise":
                raise
        rows = [np.broadcast_to(x, (*batch, x.shape[-1])).reshape(-1, x.shape[-1]) for x in arrays.values()]
        result = np.full((len(rows[0]), *shape), arithmetic.number("nan"), dtype=arithmetic.dtype)
        _halved(attempt, rows, result, 0, len(result), batch, errors)
        _together(attempt, rows, result, arithmetic)
    return result.reshape((*batch, *shape))


def _together(attempt: Callable[..., Array], rows: list[Array], result: Array, arithmetic: Arithmetic) -> None:
    """Answer the states that have an answer in one batch, another state in place of those that have none.

    So they are what they would be beside any other states, to the last bit: a kernel may round a part of a batch, or
    one state, in another way.
    """
    answers: np.ndarray = np.all(arithmetic.finite(result).reshape(len(result), -1), axis=1)
    if answers.all() or not answers.any():
        return
    some = int(np.argmax(answers))
    with suppress(*_REFUSALS, DoubtError):  # a doubt about the batch as a whole
        whole = attempt(*(np.where(answers[:, None], x, x[some]) for x in rows))
        result[answers] = whole[answers]


def _halved(
    attempt: Callable[..., Array],
    rows: list[Array],
    result: Array,
    start: int,
    stop: int,
    batch: tuple[int, ...],
    errors: str,
) -> None:
    """Answer the states start … stop − 1; with errors="nan" those without an answer stay as they are."""
    alone = stop - start == 1
    try:
        result[start:stop] = attempt(*(x[start] if alone else x[start:stop] for x in rows))
    except (*_REFUSALS, DoubtError) as error:
        if not alone:
            middle = (start + stop) // 2
            _halved(attempt, rows, result, start, middle, batch, errors)
            _halved(attempt, rows, result, middle, stop, batch, errors)
        elif errors == "raise":
            error.row = tuple(int(i) for i in np.unravel_index(start, batch))
            where = error.row[0] if len(batch) == 1 else error.row
            error.args = (f"{error} in row {where} of the batch",)
            raise


def into(out: Any, result: Any) -> Any:
    """Return the result, in `out` if that is an array; QueryError if it does not fit."""
    if out is None:
        return result
    result = np.asarray(result)
    if not isinstance(out, np.ndarray) or out.dtype != result.dtype or out.shape != result.shape:
        got = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else repr(out)
        raise QueryError(f"out must be an array of {result.dtype} and shape {result.shape}, got {got}")
    if not out.flags.writeable:
        raise QueryError("out must be writable, got a read-only array")
    out[...] = result
    return out
