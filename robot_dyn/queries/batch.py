"""Batches: a query evaluates all states, or raises an error that names the first state without a result.

For `nan_rows`, the result of such states is NaN. A batch is evaluated as a whole; if that fails, it is halved until the
states without a result are isolated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress

import numpy as np

from robot_dyn.foundations.arithmetic import FLOAT64, Arithmetic, Array
from robot_dyn.foundations.errors import (
    NotFiniteError,
    OverflowedError,
    QueryError,
    RobotDynError,
    SingularError,
)
from robot_dyn.foundations.validate import check_batches, converted

_REFUSALS = (NotFiniteError, OverflowedError, SingularError)  # errors of one state; others concern the query


class DoubtError(RobotDynError):
    """Internal: a state of a batch must be evaluated separately."""


def answered(
    equation: Callable[..., Array],
    arrays: Mapping[str, Array],
    shape: tuple[int, ...],
    joint_names: tuple[str, ...],
    nan: bool = False,
    arithmetic: Arithmetic = FLOAT64,
) -> Array:
    """Return the results of a batch of states, (..., *shape).

    Args:
        equation: (x₁, x₂, …) → results, for one state (n,) or a batch; may raise SingularError or OverflowedError.
        arrays: Arguments by name, each (..., n), or (..., 1) for the time t; floats and integers of any type.
        shape: Shape of the result for one state.
        joint_names: Names of the joints, for messages.
        nan: True for NaN at states without a result, False for an error.
        arithmetic: Arithmetic of arguments and results.

    Raises:
        QueryError: If the batch axes do not match.
        NotFiniteError: If an argument is not finite.
        OverflowedError: If a result is not finite, or q or t is too large for the arithmetic.
        SingularError: If M is singular in forward dynamics. In a batch, the last three name the row.
    """
    batch = check_batches(**arrays)

    def attempt(*values: Array) -> Array:
        named = zip(arrays, values, strict=True)
        answer = equation(*(converted(name, x, joint_names, arithmetic) for name, x in named))
        if isinstance(answer, np.ndarray) and answer.dtype == object:
            answer = arithmetic.array(answer)  # constant entries 0 and 1 may still be integers
        if not arithmetic.finite(answer).all():
            raise OverflowedError(
                f"the result overflows: {', '.join(arrays)} {'is' if len(arrays) == 1 else 'are'} too large"
            )
        return answer

    if 0 in batch:
        return np.zeros((*batch, *shape), dtype=arithmetic.dtype)
    with np.errstate(all="ignore"):  # overflow raises an error below
        try:
            return attempt(*arrays.values())
        except (*_REFUSALS, DoubtError):
            if not batch and not nan:
                raise
        rows = [np.broadcast_to(x, (*batch, x.shape[-1])).reshape(-1, x.shape[-1]) for x in arrays.values()]
        result = np.full((len(rows[0]), *shape), arithmetic.number("nan"), dtype=arithmetic.dtype)
        _halved(attempt, rows, result, 0, len(result), batch, nan)
        _in_one_batch(attempt, rows, result, arithmetic)
    return result.reshape((*batch, *shape))


def _in_one_batch(attempt: Callable[..., Array], rows: list[Array], result: Array, arithmetic: Arithmetic) -> None:
    """Evaluate all states with a result in one batch, in which a copy of the first of them replaces each other state.

    Their bits then do not depend on the other states: a kernel may round a single state, or part of a batch,
    differently.
    """
    answers: np.ndarray = np.all(arithmetic.finite(result).reshape(len(result), -1), axis=1)
    if answers.all() or not answers.any():
        return
    replacement = int(np.argmax(answers))
    with suppress(*_REFUSALS, DoubtError):  # if the whole batch fails, the separate results remain
        whole = attempt(*(np.where(answers[:, None], x, x[replacement]) for x in rows))
        result[answers] = whole[answers]


def _halved(
    attempt: Callable[..., Array],
    rows: list[Array],
    result: Array,
    start: int,
    stop: int,
    batch: tuple[int, ...],
    nan: bool,
) -> None:
    """Evaluate the states start … stop − 1; with `nan`, states without a result are left unchanged."""
    alone = stop - start == 1
    try:
        result[start:stop] = attempt(*(x[start] if alone else x[start:stop] for x in rows))
    except (*_REFUSALS, DoubtError) as error:
        if not alone:
            middle = (start + stop) // 2
            _halved(attempt, rows, result, start, middle, batch, nan)
            _halved(attempt, rows, result, middle, stop, batch, nan)
        elif not nan:
            error.row = tuple(int(i) for i in np.unravel_index(start, batch))
            where = error.row[0] if len(batch) == 1 else error.row
            error.args = (f"{error} in row {where} of the batch",)
            raise


def into(out: np.ndarray | None, result: np.ndarray) -> np.ndarray:
    """Return the result, in `out` if that is an array; raise QueryError if it does not fit."""
    if out is None:
        return result
    array = np.asarray(result)
    if not isinstance(out, np.ndarray) or out.dtype != array.dtype or out.shape != array.shape:
        got = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else repr(out)
        raise QueryError(f"out must be an array of {array.dtype} and shape {array.shape}, got {got}")
    if not out.flags.writeable:
        raise QueryError("out must be writable, got a read-only array")
    out[...] = array
    return out
