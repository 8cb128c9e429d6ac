"""A second call of one setup computes what depends on the run alone; what waits until it is read is what it would be.

Nothing is kept of parts that may change between two calls, and nothing of their runs waits.
"""

from __future__ import annotations

import gc
import pickle
import sys
from array import array
from collections import Counter, OrderedDict, deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from copy import copy, deepcopy
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import Trajectory
from robot_dyn.simulation import Ending, RemarkKind, StateEquation
from robot_dyn.simulation.compiled.machine_code import MachineCode
from robot_dyn.simulation.run import event_handler
from robot_dyn.simulation.setup.setup import CACHED
from tests.campaigns.estimates.scenes import arms
from tests.long import third

ARM = rd.load("planar_2r")
Q, V = np.array([0.3, -0.4]), np.array([0.5, -0.2])
PLAN = rd.control.quintic(Q, Q + 0.4, 0.2)
NAMES = [each.name for each in fields(Trajectory)]
WITHOUT_TIMES = [name for name in NAMES if name != "statistics"]


@cache
def setups() -> dict[str, rd.Setup]:
    """Setups of values: levels that are passed, ticks, thresholds, states, what comes and goes, an open ledger."""
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction(0.3), rd.effects.EffortLimit([4.0, 2.0])])
    sampled = rd.control.PD(PLAN, kp=[60.0, 30.0], kd=[6.0, 3.0], period_s=0.01)
    stops = rd.effects.joint_stops([-0.5, -0.5], [0.5, 0.5], 2e3, 0.1)
    held = [rd.effects.DryFriction([1.5, 0.5]), rd.effects.RigidStops(-0.6, 0.6)]
    tool = rd.effects.CarriedPayload(rd.Payload("tip", 0.5), 0.05, 0.12)
    pid = rd.control.PID(PLAN, kp=60.0, ki=20.0, kd=6.0)
    compiled: dict[str, Any] = {"engine": "compiled", "duration_s": 0.2}
    short: dict[str, Any] = {
        "engine": "interpreted",
        "duration_s": 0.2,
        "method": "DOP853",
        "record_every_s": 0.02,
    }
    return {
        "free swing": rd.Setup(rd.Plant(ARM), Q, V, method="DOP853", **compiled),
        "computed torque": rd.Setup(
            plant, Q, V, controller=rd.control.ComputedTorque(ARM, PLAN, kp=90.0, kd=15.0),
            **compiled, metadata={"author": "me"},
        ),
        "sampled, RK4": rd.Setup(plant, Q, V, controller=sampled, method="RK4", **compiled),
        "steps too long": rd.Setup(
            rd.Plant(ARM), Q, 10 * V, 1.0, method="RK4", step_s=0.05, engine="interpreted"
        ),
        "stops": rd.Setup(rd.Plant(ARM, [*stops, rd.effects.Spring(3.0)]), Q, 10 * V, estimate_error=False, **short),
        "held": rd.Setup(rd.Plant(ARM, held), Q, 4 * V, estimate_error=False, **short),
        "payload": rd.Setup(rd.Plant(ARM, [tool]), Q, V, estimate_error=False, **short),
        "pid, lag": rd.Setup(
            rd.Plant(ARM, [rd.effects.ActuatorLag(0.02), rd.effects.ExternalWrench("tip", [1, 2, 3, 0, 0, 1])]), Q, V,
            controller=pid, estimate_error=False, **short,
        ),
    }  # fmt: skip


def assert_same(one: Any, other: Any) -> None:
    """The same types and bits, all through."""
    assert type(one) is type(other)
    if isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert np.ascontiguousarray(one).tobytes() == np.ascontiguousarray(other).tobytes()
    elif isinstance(one, dict):
        assert list(one) == list(other)
        for key in one:
            assert_same(one[key], other[key])
    elif is_dataclass(one):
        for each in fields(one):
            assert_same(getattr(one, each.name), getattr(other, each.name))
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for pair in zip(one, other, strict=True):
            assert_same(*pair)
    else:
        assert one == other or one != one


def assert_same_run(one: Trajectory, other: Trajectory) -> None:
    """But for what they took of the clock."""
    for name in WITHOUT_TIMES:
        assert_same(getattr(one, name), getattr(other, name))


def at_once(setup: rd.Setup) -> Trajectory:
    """Its run as it would be if a part of it might change: of that nothing is kept, and nothing waits."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rd.Setup, "is_value", False)
        run = rd.simulate(replace(setup))
    assert vars(run).keys() == set(NAMES)
    return run


def test_the_setups_leave_something_to_read() -> None:
    runs = {name: rd.simulate(setup) for name, setup in setups().items()}
    kinds = {remark.kind for run in runs.values() for remark in run.remarks}
    assert kinds >= {RemarkKind.EFFORT_REACHED, RemarkKind.STOP_REACHED, RemarkKind.JUMPS}
    assert runs["steps too long"].ledger.cause and runs["pid, lag"].wrenches and runs["stops"].at_stop is not None
    assert all(runs[name].events for name in ("computed torque", "stops", "held", "payload"))


def test_fields_that_were_not_read_are_listed() -> None:
    """As `run.` and tab asks for them, and as those of a run whose fields were all computed at once."""
    run = rd.simulate(setups()["free swing"])
    assert "q" not in vars(run)
    assert {*NAMES} <= {*dir(run)} and "_source" not in dir(run)
    assert dir(run) == dir(at_once(setups()["free swing"]))


SHARED = ("computed torque", "held", "pid, lag")


@pytest.mark.parametrize("name", setups())
def test_what_is_read_late_is_what_it_would_be_at_once_in_whatever_order(name: str) -> None:
    setup = setups()[name]
    reference, rng = at_once(setup), np.random.default_rng(3)
    assert reference.outcome.ending is Ending.FINISHED
    orders = [NAMES, NAMES[::-1], list(rng.permutation(NAMES))]
    for order in orders:
        run = rd.simulate(setup)
        assert "remarks" not in vars(run) and "ledger" not in vars(run)
        for field in order:
            getattr(run, field)
        assert_same_run(run, reference)
        assert vars(run).keys() == set(NAMES)  # what it was read from is let go
    assert rd.simulate(setup).summary.split("time:")[0] == reference.summary.split("time:")[0]


@pytest.mark.parametrize("name", [*SHARED, *third(name for name in setups() if name not in SHARED)])
def test_runs_of_one_setup_do_not_share_what_they_change(name: str) -> None:
    setup = replace(setups()[name])  # of which nothing is kept yet
    first = rd.simulate(setup)
    with ThreadPoolExecutor(3) as pool:
        for run in pool.map(lambda _: rd.simulate(setup), range(6)):
            assert_same_run(run, first)


def test_threads_that_read_one_run_read_the_same() -> None:
    """What is summed up at the end, such as chatter, is so once."""
    setup, rng = setups()["sampled, RK4"], np.random.default_rng(5)
    reference = at_once(setup)
    for _ in range(5):
        run = rd.simulate(setup)
        with ThreadPoolExecutor(4) as pool:
            names = [name for _ in range(4) for name in rng.permutation(NAMES).tolist()]
            read = list(pool.map(lambda name, run=run: getattr(run, name), names))
        for name, value in zip(names, read, strict=True):
            assert value is getattr(run, name)
        assert_same_run(run, reference)


@pytest.mark.parametrize("events", [(), (rd.Event(lambda t, q, v: q[0] - 0.35),)])
def test_what_is_kept_does_not_grow_with_the_runs(events: tuple[rd.Event, ...]) -> None:
    """Also where machine code is chosen anew for each run, as it is with events, and the mode changes in it."""
    setup = replace(setups()["computed torque"], events=events, estimate_error=False)

    def held() -> int:
        gc.collect()
        return sum(isinstance(each, MachineCode | StateEquation) for each in gc.get_objects())

    for _ in range(2):
        assert rd.simulate(setup).events
    before = held()
    for _ in range(4):
        rd.simulate(setup)
    assert held() == before


def calls(function: Callable[[], object]) -> Counter[str]:
    """How often each function was called, by its name; those of C together."""
    found: Counter[str] = Counter()

    def count(frame: Any, event: str, argument: Any) -> None:
        if event in ("call", "c_call"):
            found[frame.f_code.co_qualname if event == "call" else "C"] += 1

    sys.setprofile(count)
    try:
        function()
    finally:
        sys.setprofile(None)
    return found


# Of Python and C: some 1000 without an estimate and 2100 with one, about a third of each in the words of arguments.
# They were 6000 to 11 000 when a call computed anew what depends on its setup alone.
@pytest.mark.parametrize("name, estimates, most", [
    ("free swing", False, 1800), ("free swing", True, 3600), ("computed torque", False, 1800),
    ("computed torque", True, 3600),
])  # fmt: skip
def test_a_second_call_computes_nothing_that_depends_on_the_setup_alone(name: str, estimates: bool, most: int) -> None:
    setup = replace(setups()[name], estimate_error=estimates)
    rd.simulate(setup)
    found = calls(lambda: rd.simulate(setup))
    alone = {
        "_chosen", "structure", "parameters", "levels", "_plan", "cuts", "undeclared", "is_value", "Switching.at",
        "StateEquation.energies", "loop_config", "observations_of",
    }  # fmt: skip
    late = {
        "remarks", "ledger", "origin", "Observer.close", "tracking_of", "settings_of", "acting", "wrenches",
        "at_stop", "unstable",
    }  # fmt: skip
    assert not (alone | late) & found.keys()
    assert sum(found.values()) < most


class Driven(rd.control.Stateless):
    """A controller whose gain may be set, and so may change between two calls."""

    n = 2  # pyright: ignore[reportAssignmentType, reportIncompatibleMethodOverride]

    def __init__(self) -> None:
        self.gain = 1.0

    def torque(self, t, q, v, z):
        return -self.gain * q


class Pushed(rd.effects.Active):
    """An effect whose times may change between two calls."""

    def __init__(self, times: tuple[float, ...]) -> None:
        self.times = times

    @property
    def switches(self):
        return self.times

    def torque(self, dynamics, t, q, v):
        return np.array([1.0 if any(t > each for each in self.times) else 0.0, 0.0]) + 0 * q


@pytest.mark.parametrize("engine", ["interpreted", "auto"])
def test_parts_that_change_between_two_calls_are_seen(engine: str) -> None:
    controller, effect = Driven(), Pushed((0.05,))
    options: Any = {"duration_s": 0.1, "engine": engine, "method": "DOP853", "estimate_error": False}
    setup = rd.Setup(rd.Plant(ARM, [effect]), Q, V, controller=controller, **options)
    before = rd.simulate(setup)
    controller.gain, effect.times = 7.0, (0.0321,)
    after = rd.simulate(setup)
    again = rd.simulate(rd.Plant(ARM, [effect]), Q, V, controller=controller, **options)
    assert_same_run(after, again)
    assert (0.0321 in after.t, 0.0321 in before.t) == (True, False)  # steps end at the switch, as it is now
    assert abs(after.u - before.u).max() > 1.0


def test_nothing_waits_of_a_run_with_parts_of_the_users_own() -> None:
    """What they raise, `simulate` raises; what they have become later tells nothing of the run."""
    run = rd.simulate(ARM, Q, V, controller=Driven(), duration_s=0.05, method="DOP853", estimate_error=False)
    assert vars(run).keys() == set(NAMES)

    class Stores(rd.effects.Dissipative, rd.effects.Stateful):
        def state_size(self, n):
            return 1

        def torque(self, dynamics, t, q, v, z):  # pyright: ignore[reportIncompatibleMethodOverride]
            return -v

        def state_rate(self, dynamics, t, q, v, u, z):
            return np.zeros(1)

        def stored_energy(self, dynamics, t, q, z):
            if t > 0.02:
                raise LookupError("of the user's own")
            return 0.0

    with pytest.raises(LookupError, match="own"):
        rd.simulate(rd.Plant(ARM, [Stores()]), Q, V, duration_s=0.05, method="DOP853", estimate_error=False)


def test_a_robot_that_warns_warns_in_each_run_and_in_none_of_what_is_read() -> None:
    arm = rd.accuracy.warn_below(ARM, 15.9)  # of the 16 of a float: the start has fewer
    control = rd.control.PD(PLAN, kp=10.0, kd=1.0, period_s=0.01)
    changes: dict[str, Any] = {"plant": rd.Plant(arm), "controller": control, "estimate_error": False}
    counts = []
    with pytest.warns(rd.PrecisionWarning):  # so do the checks of the setup, and of its machine code
        setup = replace(setups()["sampled, RK4"], **changes)
        rd.simulate(setup)
    for _ in range(2):
        with pytest.warns(rd.PrecisionWarning) as told:
            run = rd.simulate(setup)
        counts.append(len(told))
        _ = run.summary  # warnings are errors here
    assert counts[0] == counts[1] > 5


def test_nothing_waits_of_a_run_that_did_not_finish() -> None:
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction(1e4)])
    run = rd.simulate(plant, Q, V, duration_s=0.1, method="RK4", engine="interpreted", estimate_error=False)
    assert run.outcome.ending is Ending.DIVERGED and vars(run).keys() == set(NAMES)


def test_a_text_that_is_added_to_a_setup_later_is_none_of_the_run() -> None:
    setup = replace(setups()["free swing"], metadata={"author": "me"}, estimate_error=False)
    run = rd.simulate(setup)
    setup.metadata["author"] = "you"
    assert run.metadata["author"] == "me"


@pytest.mark.parametrize("name", ["computed torque", "sampled, RK4"])
def test_what_was_not_read_is_copied_pickled_and_saved_with_the_run(name: str, tmp_path: Path) -> None:
    setup = setups()[name]
    reference = at_once(setup)
    for made in (copy, deepcopy, lambda run: pickle.loads(pickle.dumps(run)), replace):
        assert_same_run(made(rd.simulate(setup)), reference)
    back = rd.read(rd.simulate(setup).save(tmp_path / "run.npz"))
    assert back.remarks == reference.remarks and back.summary.split("time:")[0] == reference.summary.split("time:")[0]


def test_a_setup_that_has_run_is_copied_and_pickled_without_what_is_kept_with_it() -> None:
    setup = setups()["computed torque"]
    run = rd.simulate(setup)
    assert setup.cache
    for made in (copy, deepcopy, lambda each: pickle.loads(pickle.dumps(each)), replace):
        other = made(setup)
        assert vars(other).keys() <= {each.name for each in fields(setup)} | {"undeclared", "is_value", "equation"}
        assert_same_run(rd.simulate(other), run)


def test_setups_of_parts_of_the_library_are_values() -> None:
    """And those of a user's own class, or of a function, are not: even where it is frozen, its code may be another."""

    @dataclass(frozen=True)
    class Own(rd.effects.Active):
        gain: float = 1.0

        def thresholds(self, n):
            return ()

        def torque(self, dynamics, t, q, v):
            return self.gain * v

    assert all(setup.is_value for setup in setups().values())
    base = setups()["free swing"]
    for other in ({"plant": rd.Plant(ARM, [Own()])}, {"controller": lambda t, q, v: -q}, {"controller": Driven()}):
        assert not replace(base, **other, engine="interpreted").is_value


def test_an_attribute_that_is_no_field_is_none_of_an_unread_run() -> None:
    run = rd.simulate(setups()["free swing"])
    with pytest.raises(AttributeError, match=r"Trajectory.*remark_s"):
        run.remark_s  # noqa: B018 # pyright: ignore
    assert not hasattr(run, "_source_of") and "remarks" not in vars(run)


def built_by(call: Callable[[], object], monkeypatch: pytest.MonkeyPatch) -> int:
    """The number of setups that a call builds and checks."""
    count, check = [0], rd.Setup.__post_init__

    def counted(self: rd.Setup) -> None:
        count[0] += 1
        check(self)

    with monkeypatch.context() as patch:
        patch.setattr(rd.Setup, "__post_init__", counted)
        call()
    return count[0]


@pytest.mark.parametrize("what", [ARM, rd.Plant(ARM, [rd.effects.ViscousFriction(0.3)])], ids=["robot", "plant"])
def test_a_call_with_equal_arguments_builds_no_setup(what: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    controller = rd.control.PD(PLAN, kp=60.0, kd=6.0)

    def call(q0: Any = (0.3, -0.4), **more: Any) -> None:
        more = {"duration_s": 0.02, "controller": controller, "engine": "interpreted", "metadata": {"a": "b"}} | more
        rd.simulate(what, list(q0), np.array(V), **more)

    call()
    assert built_by(call, monkeypatch) == 0
    others: list[dict[str, Any]] = [
        {"q0": (0.3, -0.3)}, {"duration_s": 0.03}, {"metadata": {"a": "c"}}, {"q0": (-0.0, 0.0)}, {"q0": (0.0, 0.0)},
        {"controller": replace(controller, kp=61.0)}, {"controller": None}, {"estimate_error": False},
    ]  # fmt: skip
    assert [built_by(lambda other=other: call(**other), monkeypatch) for other in others] == [1] * len(others)


def test_a_start_changed_in_place_is_another_start() -> None:
    plant, start = rd.Plant(ARM), Q.copy()
    first = rd.simulate(plant, start, duration_s=0.02)
    start += 0.1
    second = rd.simulate(plant, start, duration_s=0.02)
    assert first.q[0].tolist() == Q.tolist() and second.q[0].tolist() == start.tolist()


class Start:
    """A start that NumPy reads by its protocol."""

    def __init__(self, values: list[float]) -> None:
        self.values = values

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray:
        return np.array(self.values, dtype)

    def __setitem__(self, i: int, x: float) -> None:
        self.values[i] = x


class Positions(list[float]):
    """A list of another class."""


@pytest.mark.parametrize("kind", [list, np.array, Positions, Start, deque, lambda x: array("d", x),
    lambda x: memoryview(array("d", x)), lambda x: np.ma.masked_array(x, [False] * len(x))])  # fmt: skip
@pytest.mark.parametrize("whole", [True, False])
def test_a_start_of_any_kind_that_is_changed_in_place_is_another_start(kind: Any, whole: bool) -> None:
    what, start = rd.Plant(ARM) if whole else ARM, kind([0.3, -0.4])
    for x in (0.3, 1.5, -0.2):
        start[0] = x
        for options in ({"q0": start}, {"q0": Q, "v0": start}):
            run = rd.simulate(what, **options, duration_s=0.02, estimate_error=False, engine="interpreted")
            assert (run.v if "v0" in options else run.q)[0, 0] == x


def test_texts_that_are_changed_in_place_are_other_texts() -> None:
    plant, metadata = rd.Plant(ARM), OrderedDict(a="1")
    for text in ("1", "2", "1"):
        metadata["a"] = text
        assert rd.simulate(plant, Q, duration_s=0.02, metadata=metadata).metadata["a"] == text


def test_setups_of_parts_that_may_change_are_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user-defined controller or event may answer differently in each call."""
    event = rd.Event(lambda t, q, v: float(q[0] - 9.0), name="level")
    controllers: list[Any] = [lambda t, q, v: -q, Driven()]
    for more in (*({"controller": controller} for controller in controllers), {"events": [event]}):
        plant = rd.Plant(ARM)

        def call(plant: rd.Plant = plant, more: dict[str, Any] = more) -> object:
            return rd.simulate(plant, Q, duration_s=0.02, engine="interpreted", **more)

        call()
        assert built_by(call, monkeypatch) == 1


def test_copies_and_pickles_of_a_plant_carry_no_setup() -> None:
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction(0.3)])
    rd.simulate(plant, Q, duration_s=0.02)
    assert plant.cache
    for other in (copy(plant), deepcopy(plant), pickle.loads(pickle.dumps(plant)), pickle.loads(pickle.dumps(ARM))):
        assert not other.cache


def test_what_a_setup_caches_is_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs of all kinds, one that the stiff method replaces and one that time stepping does, fill all of the list."""
    monkeypatch.setattr(event_handler, "_MOST_CHANGES", 12)
    monkeypatch.setattr(event_handler, "_BRIEF", 1e-2)
    stiff = rd.Setup(rd.Plant(ARM, [rd.effects.ViscousFriction(1e5)]), Q, duration_s=20.0, estimate_error=False)
    bounces = rd.Setup(rd.Plant(arms()["rail"], [rd.effects.RigidStops(0.0, 2.0, 0.5)]), [0.4], duration_s=2.0)
    names: set[str] = set()
    for setup in (*setups().values(), replace(setups()["free swing"], engine="auto"), stiff, bounces):
        rd.simulate(setup)
        names |= {key.__name__ for key in setup.cache}
    assert names == CACHED.keys()
