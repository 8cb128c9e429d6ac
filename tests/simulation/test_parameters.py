"""Numbers are inputs of machine code: other values run the code that there is, and give what the interpreter gives."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.codegen.llvm import machine_code
from robot_dyn.foundations import EffectError, QueryError, TraceError, eigh, tanh
from robot_dyn.model import with_exact_right_angles
from robot_dyn.simulation.compiled import cache
from tests.long import long, stress, third

ARM = rd.load("planar_2r")
TIP = ARM.frame_names[-1]
Q, V = np.array([0.4, -0.7]), np.array([0.3, 0.5])
INERTIA = ((0.02, 0.001, 0.0), (0.001, 0.03, 0.0), (0.0, 0.0, 0.025))


def loaded(mass: float, com: tuple[float, ...], inertia=INERTIA, gravity=(0.3, 0.2, -9.7)) -> rd.Robot:
    return ARM.with_(payload=rd.Payload(TIP, mass, com, inertia), gravity=gravity)


def setup(x: float, kind: str = "computed torque") -> rd.Setup:
    """A setup whose numbers all depend on x, and whose structure does not."""
    arm = loaded(1.0 + x, (0.05 + x / 10, 0.02, 0.03 + x), gravity=(0.3 + x, 0.2, -9.7))
    effects = [
        rd.effects.ViscousFriction(0.3 + x),
        rd.effects.RegularisedCoulombFriction([0.2, 0.1 + x], 0.05 + x),
        rd.effects.Spring(1.0 + x, 0.2 - x),
        *rd.effects.joint_stops([-1.0, -0.75 + x / 10], [1.2, 1.0 + x], 300.0 + x, 20.0 + x),
        rd.effects.ExternalWrench(TIP, [1.0, 0.2 + x, 0.7, 0.1, 0.4 + x, 0.2], start_s=0.05 + x / 100, end_s=0.15),
        rd.effects.EffortLimit(30.0 + x),
    ]
    reference = rd.control.quintic(Q + x / 10, Q + 0.3, 0.2)
    model = loaded(0.8 + x, (0.01, 0.02, 0.01 + x))
    controllers = {
        "computed torque": rd.control.ComputedTorque(model, reference, kp=60.0 + x, kd=[9.0, 8.0 + x]),
        "PID": rd.control.PID(reference, kp=60.0 + x, ki=20.0 + x, kd=9.0, effort_limit=25.0 + x, period_s=0.01),
    }
    plant, steps = rd.Plant(arm, effects), ("RK4", 1e-3, 0.01, False)
    return rd.Setup(plant, Q, V, 0.2, controllers[kind], *steps, engine="compiled")


def compiles_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on a trace or a module that is not there already is an error."""

    def refuse(*_: object) -> None:
        raise AssertionError("something is compiled")

    monkeypatch.setenv("ROBOT_DYN_CACHE", "off")
    monkeypatch.setattr(cache, "_traced", refuse)
    monkeypatch.setattr(machine_code, "object_file", refuse)


@pytest.mark.parametrize("kind", ["computed torque", "PID"])
def test_other_numbers_compile_nothing(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Gains, coefficients, limits, payload, gravity, reference, start and window, of the plant and of the model."""
    rd.simulate(setup(0.0, kind))
    compiles_nothing(monkeypatch)
    for x in (0.1, 0.4):
        ours, theirs = rd.simulate(setup(x, kind)), rd.simulate(setup(x, kind), engine="interpreted")
        assert ours.statistics.engine == "compiled"
        assert np.abs(ours.q - theirs.q).max() < 1e-12  # rounding, over 200 steps


def test_another_structure_is_compiled() -> None:
    """What is not a number, such as a locked joint or the link that a wrench acts on, is not taken for one."""
    ends = []
    for frame in ARM.frame_names[1:3]:
        setup = rd.Setup(rd.Plant(ARM, [rd.effects.ExternalWrench(frame, [1.0, 0.2, 0.7, 0.1, 0.4, 0.2])]), Q)
        options = {"duration_s": 0.1, "method": "RK4"}
        ours, theirs = (rd.simulate(setup, engine=x, **options).q[-1] for x in ("compiled", "interpreted"))
        assert np.abs(ours - theirs).max() < 1e-13
        ends.append(ours)
    assert np.abs(np.subtract(*ends)).max() > 1e-3


@pytest.mark.parametrize(
    ("name", "values"),
    [
        (f"model.payload_mass:{TIP}", np.array([0.1, 2.5])),
        ("kp", np.array([[30.0, 20.0], [70.0, 80.0]])),
        *third(
            [
                ("external_wrench.wrench", np.array([[1.0, 2, 3, 0.4, 0.5, 0.6], [3.0, 1, -2, 0.1, 0.2, 0.9]])),
                ("gravity", np.array([[0.0, 0.0, -9.0], [0.4, 0.1, -3.0]])),
                ("model.gravity", np.array([[0.0, 0.0, -9.0], [0.4, 0.1, -3.0]])),
                (f"payload_com:{TIP}", np.array([[0.1, 0.0, 0.05], [-0.05, 0.02, 0.1]])),
                ("armature", np.array([[0.1, 0.02], [0.3, 0.15]])),
                ("model.mass_scale", np.array([0.7, 1.3])),
                ("joint_stops.upper", np.array([[0.45, 0.2], [0.5, 1.0]])),
                ("effort_limit.limit", np.array([2.0, 11.0])),
            ]
        ),
    ],
)
def test_every_number_is_a_sweep_parameter(name: str, values: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each run is that of the setup with this value; other values of what is swept compile nothing."""
    base = replace(setup(0.0), record_every_s=0.02)
    rd.rollouts(base, vary={name: values[::-1] + 0.01})
    compiles_nothing(monkeypatch)
    runs = rd.rollouts(base, vary={name: values})
    monkeypatch.undo()
    for i in range(2):
        own = with_value(base, name, values[i])
        theirs = rd.simulate(own, engine="interpreted").q
        assert np.abs(runs.q[i] - theirs).max() < 1e-12
    assert np.abs(runs.q[0] - runs.q[1]).max() > 1e-6


def with_value(base: rd.Setup, name: str, value: np.ndarray) -> rd.Setup:
    """The setup with one value changed, by its constructors."""
    plant, controller = base.plant, base.controller
    part, _, key = name.rpartition(".")
    if key in ("armature", "mass_scale"):
        if part:
            return replace(base, controller=replace(controller, model=controller.model.with_(**{key: value})))
        return replace(base, plant=rd.Plant(plant.dynamics.with_(**{key: value}), plant.effects))
    if key.startswith(("gravity", "payload")):
        robot = controller.model if part else plant.dynamics
        payload = robot.edits.payloads[0]
        if key != "gravity":
            payload = replace(payload, **{key.removeprefix("payload_").partition(":")[0]: value})
        robot = ARM.with_(payload=payload, gravity=value if key == "gravity" else robot.edits.gravity)
        if part:
            return replace(base, controller=replace(controller, model=robot))
        return replace(base, plant=rd.Plant(robot, plant.effects))
    if not part:
        return replace(base, controller=replace(controller, **{key: value}))
    effects = [replace(each, **{key: value}) if each.name == part else each for each in plant.effects]
    return replace(base, plant=rd.Plant(plant.dynamics, effects))


def test_sweeps_are_held_to_what_is_declared() -> None:
    base = setup(0.0)
    for params, message in (
        ({"kp": [-1.0]}, "vary: kp must not be negative"),
        ({"gravity": [[0.0, 0.0]]}, r"vary: gravity must have shape \(B, 3\)"),
        (
            {"viscous_friction.viscou": [1.0]},
            "no parameter 'viscous_friction.viscou'; nearest: viscous_friction.viscous",
        ),
        ({"external_wrench.start_s": [0.1]}, "no parameter 'external_wrench.start_s'"),
    ):
        with pytest.raises(QueryError, match=message):
            rd.rollouts(base, vary=params)


@dataclass(frozen=True, eq=False)
class Drag(rd.effects.Dissipative):
    """A user's own effect with declared coefficients, in a controller's neighbourhood of other names."""

    strength: np.ndarray = field(metadata=rd.effects.coefficient("N m", symbol="s", minimum=0, stated="damping"))
    scale: float = field(default=0.1, metadata=rd.effects.coefficient("rad/s", exclusive_minimum=0))

    def torque(self, dynamics, t, q, v):
        return -self.strength * tanh(v / self.scale)


@dataclass(frozen=True, eq=False)
class Follower(rd.control.Stateless):
    """A user's own controller: what it follows and its model are found whatever they are called."""

    path: rd.control.PiecewisePolynomial
    arm: rd.Robot
    gain: np.ndarray = field(metadata=rd.effects.coefficient("1/s²", minimum=0))
    n: int = 2

    def torque(self, t, q, v, z):
        q_d, v_d, a_d = self.path.at(t)
        return self.arm.inverse_dynamics(q, v, a_d + self.gain * (q_d - q) + 2 * (v_d - v))


def test_parts_of_a_users_own_have_all_of_it() -> None:
    """Declared coefficients are checked, given by joint name, traced as inputs and swept; any attribute is found."""
    with pytest.raises(EffectError, match="strength must not be negative"):
        Drag(-1.0)
    by_name = rd.Plant(ARM, [Drag({ARM.joint_names[1]: 0.5})])
    np.testing.assert_array_equal(by_name.effects[0].strength, [0.0, 0.5])
    path = rd.control.quintic(Q, Q + 0.2, 0.1)
    options = {"record_every_s": 0.01, "estimate_error": False}
    base = rd.Setup(by_name, Q, V, 0.2, Follower(path, ARM, 50.0), "RK4", **options)
    theirs = rd.simulate(base, engine="interpreted")
    assert np.abs(rd.simulate(base, engine="compiled").q - theirs.q).max() < 1e-12
    assert theirs.desired is not None and np.abs(theirs.desired - path.at(theirs.t)[0]).max() == 0
    runs = rd.rollouts(base, vary={"gain": [50.0, 20.0], "drag.strength": [[0.0, 0.5], [0.3, 0.1]]})
    assert np.abs(runs.q[0] - theirs.q).max() < 1e-12 < np.abs(runs.q[1] - theirs.q).max()


class Shaken(rd.control.PiecewisePolynomial):
    """A reference of a user's own that is not the polynomial that it is made of."""

    def at(self, t):
        q, v, a = super().at(t)
        return q + 0.1 * np.sin(t)[..., None], v, a


def test_a_reference_of_a_users_own_is_not_taken_for_its_polynomial() -> None:
    """Its own `at` would be lost in machine code; "auto" runs it interpreted."""
    path = rd.control.quintic(Q, Q + 0.2, 0.1)
    shaken = Shaken(path.breaks, path.coefficients)
    base = rd.Setup(rd.Plant(ARM), Q, V, 0.2, rd.control.PD(path, kp=40.0, kd=4.0), "RK4", estimate_error=False)
    rd.simulate(base, engine="compiled")
    own = replace(base, controller=rd.control.PD(shaken, kp=40.0, kd=4.0))
    assert rd.simulate(own).statistics.engine.startswith("interpreted (Shaken declares no knots")
    with pytest.raises(TraceError, match=r"Shaken cannot be compiled: its at\(t\) differs from its polynomials"):
        rd.simulate(own, engine="compiled")


UR5 = with_exact_right_angles(rd.load("ur5"))[0]
START = np.array([0.3, -0.9, 1.2, -0.6, 0.8, 0.2])


@pytest.mark.parametrize("turn", ["free", *long(["turning"]), *stress(["kept"])])
def test_operational_space_is_compiled(turn: str) -> None:
    """With the orientation free, kept and turning by 2 rad; the eigenvectors are those of another method."""
    g = UR5.placement(START, "tool0")
    p, R = g[:3, 3], g[:3, :3]
    c, s = np.cos(2.0), np.sin(2.0)
    end = R @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turns = {"free": {}, "kept": {"rotation": R}, "turning": {"rotation": R, "rotation_end": end}}
    control = rd.control.OperationalSpace(
        UR5, "tool0", rd.control.line(p, p + np.array([0.1, 0.05, -0.1]), 0.2, **turns[turn]), kp=100.0, kd=20.0
    )
    base = rd.Setup(rd.Plant(UR5), START, None, 0.2, control, "RK4", 2e-3, estimate_error=False)
    ours, theirs = rd.simulate(base, engine="compiled"), rd.simulate(base, engine="interpreted")
    assert np.abs(ours.q - theirs.q).max() < 1e-10  # of 1 rad: κ(M) is 1e3, of the task 1e2


def test_jacobi_diagonalises() -> None:
    """A = U diag(s) Uᵀ with UᵀU = 1 to rounding, spread and clustered eigenvalues; as LAPACK finds them."""
    rng = np.random.default_rng(5)
    for m in (2, 3, 6):
        for k in range(20):
            Q = np.linalg.qr(rng.normal(size=(m, m)))[0]
            A = (Q * (10 ** rng.uniform(-8, 2, m) if k % 2 else 1 + 1e-9 * rng.normal(size=m))) @ Q.T
            A = ((A + A.T) / 2).astype(np.longdouble)
            s, U = eigh(A)
            scale = np.abs(A).max() * 2.0**-63
            assert np.abs((U * s) @ U.T - A).max() < 100 * scale  # 15 rotations a sweep
            assert np.abs(U.T @ U - np.eye(m)).max() < 100 * 2.0**-63
            assert np.abs(np.sort(s) - np.linalg.eigvalsh(A.astype(float))).max() < 1e-14 * np.abs(A).max()
