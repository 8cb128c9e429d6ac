"""Former names: what users wrote for the version before runs, with the same numbers and a warning at their own line."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import former

ARM = rd.load("planar_2r")
START = {"duration_s": 0.05, "engine": "interpreted", "estimate_error": False}
GAIN = np.array([30.0, 20.0])


def warns(*names: str):
    """One warning that tells these names, at a line of this file."""
    return pytest.warns(DeprecationWarning, match=".* is now ".join(names))


class Integral(rd.Controller):
    """The new way: ż = q_d − q, τ = k z."""

    def __init__(self, period_s: float = 0.0) -> None:
        self.period_s = period_s

    n, state_size = 2, 2

    def torque(self, t, q, v, z):
        return GAIN * z

    def state_rate(self, t, q, v, z):
        return 0.3 - q

    def next_state(self, t, q, v, z):
        return super().next_state(t, q, v, z) + 1e-3


def former_integral() -> type[rd.Controller]:
    """The same written with the former names."""

    class FormerIntegral(rd.Controller):
        def __init__(self, period_s: float = 0.0) -> None:
            self.period_s = period_s

        n = 2
        torque = Integral.torque

        @property
        def memory_size(self) -> int:
            return 2

        def memory_rate(self, t, q, v, z):
            return 0.3 - q

        def next_memory(self, t, q, v, z):
            return super().next_memory(t, q, v, z) + 1e-3

    return FormerIntegral


@pytest.mark.parametrize("period_s", [0.0, 0.01])
def test_a_controller_written_with_former_names_gives_the_same_run(period_s: float) -> None:
    with pytest.warns(DeprecationWarning) as told:
        made = former_integral()(period_s)
    names = [("memory_size", "state_size"), ("memory_rate", "state_rate"), ("next_memory", "next_state")]
    assert [str(each.message).split(";")[0] for each in told] == [f"FormerIntegral.{a} is now {b}" for a, b in names]
    assert {each.filename for each in told} == {__file__}
    expected = rd.simulate(ARM, q0=[0.1, -0.2], controller=Integral(period_s), **START)
    if period_s:
        with warns("next_memory", "next_state"):  # its own super().next_memory
            run = rd.simulate(ARM, q0=[0.1, -0.2], controller=made, **START)
    else:
        run = rd.simulate(ARM, q0=[0.1, -0.2], controller=made, **START)
    np.testing.assert_array_equal(run.q, expected.q)
    assert run.controller_states is not None and expected.controller_states is not None
    np.testing.assert_array_equal(run.controller_states, expected.controller_states)


def test_a_subclass_of_a_former_controller_overrides_it() -> None:
    with pytest.warns(DeprecationWarning):

        class Twice(former_integral()):  # type: ignore[misc]
            def memory_rate(self, t, q, v, z):
                return 2 * super().memory_rate(t, q, v, z)

    q = np.array([0.1, -0.2])
    np.testing.assert_array_equal(Twice().state_rate(0.0, q, q, q), 2 * (0.3 - q))


def test_controllers_answer_to_former_names() -> None:
    controller, q = Integral(0.01), np.array([0.1, -0.2])
    with warns("Integral.memory_size", "state_size") as told:
        assert controller.memory_size == 2
    assert told[0].filename == __file__
    with warns("Integral.memory_rate", "state_rate"):
        np.testing.assert_array_equal(controller.memory_rate(0.0, q, q, q), 0.3 - q)
    with warns("Integral.next_memory", "next_state"):
        np.testing.assert_array_equal(controller.next_memory(0.0, q, q, q), controller.next_state(0.0, q, q, q))


def test_former_names_of_classes_and_attributes() -> None:
    import robot_dyn.control.controller as module

    with warns("robot_dyn.Memoryless", "Stateless"):
        assert rd.Memoryless is rd.Stateless  # type: ignore[attr-defined]
    with warns("Memoryless", "Stateless"):
        assert module.Memoryless is rd.Stateless  # type: ignore[attr-defined]
    with warns("Robot.ties", "couplings"):
        assert ARM.ties is ARM.couplings
    setup = rd.Setup(rd.Plant(ARM), [0.1, -0.2], controller=rd.PD(rd.hold([0.1, 0.2]), GAIN, GAIN), **START)
    with warns("Setup.stretches", "segments"):
        assert setup.stretches is setup.segments
    run = rd.simulate(setup)
    with warns("Trajectory.wanted", "desired"):
        assert run.wanted is run.desired is not None
    assert set(rd._FORMER).isdisjoint(rd.__all__)


def test_former_arguments() -> None:
    @former.arguments(length="length_s")
    def wait(q, *, length_s):
        return q, length_s

    with warns("length of .*wait", "length_s") as told:
        assert wait(1, length=2.0) == (1, 2.0)
    assert told[0].filename == __file__
    assert wait(1, length_s=2.0) == (1, 2.0)
    with pytest.raises(TypeError, match="length_s twice: length is its former name"):
        wait(1, length=1.0, length_s=2.0)


def test_the_method_that_was_scipys_is_rosenbrock_now() -> None:
    with pytest.warns(DeprecationWarning, match="the method Radau is now Rosenbrock") as told:
        assert rd.Adaptive("Radau", rtol=1e-6) == rd.Adaptive("Rosenbrock", rtol=1e-6)
    assert told[0].filename == __file__
