"""What goes into a compiled query, and where its answer goes: it is that of Robot, or of the plant, all the same."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError, TraceError
from tests.user_parts import Push

ARM = rd.load("planar_2r")
FAST = rd.compiled(ARM)
WINDOW = rd.effects.ExternalWrench("tip", [1.0, 0, 2, 0, -0.5, 0], start_s=0.2, end_s=0.6)
PUSHED = rd.Plant(ARM, [rd.effects.ViscousFriction(0.3), WINDOW])
PLANT = rd.compiled(PUSHED)
FAR = 2 * np.pi * 40_000


def state(far: bool) -> list[np.ndarray]:
    q = np.array([0.3, -0.8])
    return [q + FAR if far else q, np.array([0.5, 0.4]), np.array([1.0, -2.0])]


@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("alias", [0, 1, 2])
@pytest.mark.parametrize("name", ["forward_dynamics", "inverse_dynamics"])
def test_an_answer_may_take_the_place_of_an_argument(name: str, alias: int, far: bool) -> None:
    """Also where the kernel gives up and another way is gone: 1e-9, a turn of 40 000 leaves that much of an angle."""
    right = getattr(ARM, name)(*state(far))
    given = state(far)
    np.testing.assert_allclose(getattr(FAST, name)(*given, out=given[alias]), right, rtol=1e-9, atol=1e-9)
    rows = [np.tile(x, (20, 1)) for x in state(far)]
    np.testing.assert_allclose(getattr(FAST, name)(*rows, out=rows[alias])[7], right, rtol=1e-9, atol=1e-9)
    timed = state(far)
    plain = getattr(PUSHED, name)(*state(far), t=0.3)
    np.testing.assert_allclose(getattr(PLANT, name)(*timed, t=0.3, out=timed[alias]), plain, rtol=1e-9, atol=1e-9)


def test_an_error_names_the_joint_though_the_answer_was_to_go_there() -> None:
    q, v, tau = state(False)
    q[1] = np.nan
    with pytest.raises(QueryError, match=f"q must be finite, got nan for joint '{ARM.joint_names[1]}'"):
        FAST.forward_dynamics(q, v, tau, out=q)


@pytest.mark.parametrize("count", [3, 20])
def test_times_broadcast_like_any_argument(count: int) -> None:
    """Times (B,) go with states (B, n); a time (B, 1) with states (B, n) gives (B, B, n), however many they are."""
    t = np.linspace(0.0, 1.0, count)
    q, v, u = (np.tile(x, (count, 1)) for x in state(False))
    each = np.array([PUSHED.forward_dynamics(q[0], v[0], u[0], t=float(time)) for time in t])
    np.testing.assert_allclose(PLANT.forward_dynamics(q, v, u, t=t), each, rtol=1e-11)
    square = PLANT.forward_dynamics(q, v, u, t=t[:, None])
    np.testing.assert_allclose(square, np.broadcast_to(each[:, None], (count, count, 2)), rtol=1e-11)


@pytest.mark.parametrize("count", [3, 20])
def test_one_odd_state_of_a_timed_batch_is_told_or_answered(count: int) -> None:
    t, (q, v, u) = np.linspace(0.0, 1.0, count), (np.tile(x, (count, 1)) for x in state(False))
    v[1] = 1e8  # doubtful: the interpreted plant answers
    each = np.array([PUSHED.forward_dynamics(q[i], v[i], u[i], t=float(t[i])) for i in range(count)])
    np.testing.assert_allclose(PLANT.forward_dynamics(q, v, u, t=t), each, rtol=1e-9)
    q[2, 0] = np.nan
    with pytest.raises(QueryError, match="q must be finite, got nan for joint"):
        PLANT.forward_dynamics(q, v, u, t=t)


@pytest.mark.parametrize("count", [3, 20])
def test_arrays_of_other_kinds_are_taken_or_refused(count: int) -> None:
    rows = [np.tile(x, (count, 1)) for x in state(False)]
    right = ARM.forward_dynamics(*rows)
    masked = [np.ma.masked_array(x) for x in rows]
    np.testing.assert_allclose(FAST.forward_dynamics(*masked), right, rtol=1e-12)
    whole = [1, 2], np.array([1, -1]), np.array([[3, 0]] * count, np.int8)
    np.testing.assert_allclose(FAST.forward_dynamics(*whole), ARM.forward_dynamics(*whole), rtol=1e-12)
    locked = np.empty((count, 2))
    locked.flags.writeable = False
    with pytest.raises(QueryError, match="read-only"):
        FAST.forward_dynamics(*rows, out=locked)
    raw = np.zeros(16 * count + 1, np.uint8)[1:].view(np.float64).reshape(count, 2)  # no multiple of 8 bytes
    np.testing.assert_allclose(FAST.forward_dynamics(*rows, out=raw), right, rtol=1e-12)
    for t in (10**400, [None], "now"):
        with pytest.raises(QueryError, match="t must be a time"):
            PLANT.forward_dynamics(*rows, t=t)


SAME: dict[str, Callable[[np.ndarray], Any]] = {
    "contiguous": np.array,
    "strided": lambda x: np.repeat(x, 2)[::2],
    "backwards": lambda x: x[::-1].copy()[::-1],
    "big-endian": lambda x: x.astype(">f8"),
    "misaligned": lambda x: np.frombuffer(b"0" + x.tobytes(), offset=1),
    "float32": lambda x: x.astype(np.float32),
    "masked": np.ma.masked_array,
    "records": lambda x: x.view(np.recarray),
    "a list": list,
}


@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("form", SAME)
def test_numbers_of_any_form_give_the_same_answer(form: str, place: int) -> None:
    """The numbers are exact in float32."""
    for name in ("forward_dynamics", "inverse_dynamics"):
        given: list[Any] = [np.array([0.25, -0.75]), np.array([0.5, 0.375]), np.array([1.0, -2.0])]
        right = getattr(ARM, name)(*given)
        timed = getattr(PUSHED, name)(*given, t=0.25)
        given[place] = SAME[form](given[place])
        np.testing.assert_allclose(getattr(FAST, name)(*given), right, rtol=1e-12)
        np.testing.assert_allclose(getattr(PLANT, name)(*given, t=0.25), timed, rtol=1e-12)


WRONG: list[Any] = [np.ones(1), np.ones(3), np.array(1.0), [1.0, "x"], None, np.array([1.0, np.nan])]
WRONG += [np.full(2, np.inf), np.full((3, 2), np.nan), *(np.ones(2, kind) for kind in ("M8[s]", complex, object))]


@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_no_state_is_refused_in_the_words_of_the_robot(wrong: Any, place: int) -> None:
    given: list[Any] = state(False)
    given[place] = wrong
    refusals = []
    for ask in (ARM.forward_dynamics, FAST.forward_dynamics, partial(PLANT.forward_dynamics, t=0.25)):
        with pytest.raises(QueryError) as refused:
            ask(*given)
        refusals.append(str(refused.value))
    assert refusals[0] == refusals[1]


def test_batches_that_do_not_match_are_refused() -> None:
    with pytest.raises(QueryError, match="batch axes do not match"):
        FAST.inverse_dynamics(np.ones((2, 2)), np.ones((3, 2)), np.ones(2))


@pytest.mark.parametrize(("engine", "time"), [(FAST, {}), (PLANT, {"t": 0.3})], ids=["robot", "plant"])
def test_what_was_used_can_be_pickled(engine: Any, time: dict[str, float]) -> None:
    """As its robot or plant and its options; the kernels are made again."""
    right = engine.forward_dynamics(*state(False), **time)
    again = pickle.loads(pickle.dumps(engine))
    np.testing.assert_array_equal(again.forward_dynamics(*state(False), **time), right)


@pytest.mark.parametrize(
    "does",
    [lambda t, q, v: None, lambda t, q, v: v[q > 0], lambda t, q, v: np.sort(np.concatenate([q, v] * 4))[:2]],
    ids=["None", "index", "branches"],
)
def test_an_effect_that_cannot_be_traced_is_named(does) -> None:
    with pytest.raises(TraceError, match="effect push cannot be compiled"):
        rd.compiled(rd.Plant(ARM, [Push(does)])).torque(*state(False)[:2], t=0.0)


def test_one_sided_stops_are_compiled_exactly() -> None:
    """No digit of the stop that is not there, 1e9 away, is in the torque of the one that is."""
    plant = rd.Plant(ARM, [*rd.effects.joint_stops(-3.0, np.inf)])
    q, v = np.array([-3.05, -2.9]), np.array([0.2, -0.1])
    np.testing.assert_allclose(rd.compiled(plant).torque(q, v, t=0.0), plant.torque(q, v, t=0.0), rtol=1e-13)
