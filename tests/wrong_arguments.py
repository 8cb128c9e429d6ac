"""A valid call of every public callable, and what is wrong in place of each of its arguments."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from inspect import isabstract, isclass, signature
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

import robot_dyn as rd
from robot_dyn.control import Controller
from robot_dyn.effects import Bound, Conservative, Drive, Effect, Force, Stateful
from robot_dyn.foundations import Answer, Arithmetic, declared
from robot_dyn.integrate import System
from tests.effect_examples import EFFECTS, arguments
from tests.queries import ARGUMENTS, FRAMED

Example = tuple[Callable[..., Any], dict[str, Any]]
NAN, INF = float("nan"), float("inf")
MASKED = np.ma.masked_array([0.1, 0.2], [False, True])
NOT_REAL: tuple[Any, ...] = (1j, True, "one", b"1", object(), [[0.1], [0.1, 0.2]], MASKED, 10**400, {}, [True, 0.2], rd)
NOT_NUMBERS = (*NOT_REAL, NAN, INF, -INF, [0.1, NAN], None, np.ones((7, 1)), np.zeros((0, 3)))
NOT_WHOLE = (*NOT_NUMBERS, -1, 0.5, [1])
# Of which each is right for some arguments: they are answered or refused, and raise nothing else.
EXTREME = (
    np.array(5), np.array(0.5), np.array("q"), np.array(None), np.float64(0.5), np.float32(0.5), np.int8(5), None, "\0",
    "a\0b.toml", 5e-324, 1e-320, -1e-320, 1.7e308, 2**63, [5e-324, 1e-320], [None, None], {"a": np.array(5)},
)  # fmt: skip
LONG = {"Adaptive.solve": {"t1"}, "stress": {"budget_s"}}  # that may ask for hours of work
NOT_TEXT = (None, 3, NAN, True, b"arm", object(), ["arm"], {}, np.ones(2), 10**5000)
NOT_OBJECTS = (None, 3, NAN, True, "no such", object(), np.ones(2), MASKED, {"a": 1}, rd.Robot, 10**5000)

# Made by the library: their constructors take what it computed.
RESULTS = {
    "Advice", "AlarmThreshold", "CFunction", "CSource", "Cause", "Certificate", "Checkup", "Comparison", "Contact",
    "Cost", "Estimate", "Excitation", "Experiment", "ExternalTorque", "ExpectedPrecision", "HeldOut", "Identification",
    "InverseKinematics", "Meaning", "MotorBudget", "Motors", "Parameter", "PathPlan", "PayloadEstimate", "Plan",
    "Proof", "Rollouts", "RoundedAngle", "Run", "RunDifference", "SampledModel", "Sensitivity", "State",
    "StaticEstimate", "Stress", "SweepResult", "SymbolicEquations", "Trajectory", "Verdict", "WorkPrecision",
    "RobotDifference",
}  # fmt: skip
# For authors of effects, controllers and methods: called with numbers that were checked before.
FOR_AUTHORS = {
    "Dynamics", "Effect", "EquationOfMotion", "HeldJoint", "Interval", "Mode", "CartesianReference", "ControlLaw",
    "TaskDynamics", "ButcherTableau", "RosenbrockTable", "Surd", "System",
    "RightSide", "FixedStepper", "Solution", "Status", "IntegrationError", "ExplicitRungeKutta", "SemiImplicitEuler",
    "GaussLegendre", "Rosenbrock", "MoreauJean",
}  # fmt: skip
# What time loops and traces call, with numbers that were checked before, or symbols.
INTERFACES = (Effect, Controller, rd.control.Block, Arithmetic)
FOR_LOOPS = {
    name
    for kind in (Force, Conservative, Bound, Stateful, Drive, Controller, rd.control.Block, Arithmetic)
    for name in dir(kind)
}
FOR_LOOPS |= {
    "task_acceleration", "in_mode", "at_rest", "sliding", "touched", "snapped", "penetration", "reversals", "friction",
    "bounds", "per_joint", "reflected", "drag",
}  # fmt: skip
LAX = {  # arguments that may be infinite or unknown, or of any shape
    "CarriedPayload.acts": {"t"},
    "choice": {"values"},
    "ExternalWrench.acts": {"t"},
    "Adaptive": {"max_step_s"}, "Adaptive.with_tolerances": {"longest_s"},
    "Event": {"direction"}, "PID": {"effort_limit"},
    "PiecewisePolynomial.at": {"t"}, "Samples.at": {"t"},
    "Rollouts.outcome": {"run"}, "Rollouts.setup_of": {"run"}, "Robot.with_": {"lock", "armature"},
    "midpoint": {"x"}, "radius": {"x"}, "coefficient": {"fill_value"},
    "joint_stops": {"lower", "upper"}, "plot": {"limits"},
    "path": {"acceleration", "effort", "velocity"}, "budget": {"continuous", "effort", "velocity"},
    "point_to_point": {"jerk", "velocity"},
}  # fmt: skip
LAX |= {name: {key for key, each in declared(kind).items() if each.infinite} for name, kind in EFFECTS.items()}
SIGNED = {"Adaptive": ("rtol", "atol", "max_step_s"), "Payload": ("mass",), "Setup": ("duration_s", "step_s")}


TOOLS = (
    rd.tools.doctor,
    rd.tools.export,
    rd.tools.identify,
    rd.tools.motors,
    rd.tools.proof,
    rd.tools.step,
    rd.tools.stress,
    rd.tools.sweeps,
    rd.tools.symbols,
)
ROOMS = (rd, rd.effects, rd.control, rd.integrate, rd.accuracy, *TOOLS)

SHOWS = {"blocks", "tables", "to_json"}  # methods of answers, which take no argument
OF_EXTRAS = {"to_pandas", "to_xarray", "samples"}  # take none either, and need packages that may be absent
OF_GYMNASIUM = {"close", "close_extras", "render", "get_wrapper_attr", "has_wrapper_attr", "set_wrapper_attr"}


def public() -> Iterator[str]:
    """Names of all public callables: functions, classes and their public methods."""
    for name, thing in {name: getattr(room, name) for room in ROOMS for name in room.__all__}.items():
        if (
            not callable(thing)
            or name in FOR_AUTHORS
            or isabstract(thing)
            or (isclass(thing) and issubclass(thing, BaseException | Warning))
        ):
            continue  # interfaces are held by what implements them
        if name not in RESULTS:
            yield name
        for method in dir(thing) if isclass(thing) else ():
            field = method in getattr(thing, "__dataclass_fields__", {})
            for_loops = issubclass(thing, INTERFACES) and method in FOR_LOOPS
            shows = issubclass(thing, Answer) and method in SHOWS
            if method.startswith("_") or not callable(getattr(thing, method)):
                continue
            if not (field or for_loops or shows or method in OF_EXTRAS | OF_GYMNASIUM):
                yield f"{name}.{method}"


def examples(folder: Path) -> dict[str, Example]:
    """By name, a callable and arguments that it takes."""
    robot = rd.load("cart_pole")
    q, v, u = np.array([0.3, -0.4]), np.array([0.7, 1.1]), np.array([1.3, 0.9])
    friction, hold = rd.effects.ViscousFriction(0.1), rd.control.hold(q)
    certified = rd.accuracy.certify(robot, samples=100, repeats=1)
    plant, own = rd.Plant(robot, [friction]), rd.Lagrangian(robot)
    setup = rd.Setup(plant, q, duration_s=0.01, method="RK4")
    run, several = rd.simulate(setup), rd.rollouts(setup, np.tile(q, (2, 1)))
    proven = rd.tools.proof.prove(setup, bits=53)
    measured = rd.accuracy.work_precision(
        replace(setup, engine="interpreted"), methods=["RK4"], budget_s=2.0, repeats=1
    )
    priced = rd.accuracy.cost(setup, budget_s=1e-9, repeats=1)
    saved, scene, urdf = run.save(folder / "run"), folder / "scene.toml", folder / "arm.urdf"
    scene.write_text('robot = "cart_pole"\nduration_s = 0.01\n', encoding="utf-8")
    urdf.write_bytes(robot.description.xml)
    of_sweep = folder / "of_sweep.toml"
    start = '{q0 = "normal(mean=[0.1, 0.2], sd=0.1)"}'
    of_sweep.write_text(f'{scene.read_text()}method = "RK4"\n[sweep]\nruns = 48\nvary = {start}\n', encoding="utf-8")
    sweep = rd.tools.sweeps.from_scene(of_sweep, figures={"end": rd.tools.sweeps.final("q", "slide")})
    swept = rd.tools.sweeps.run(sweep, folder / "sweep", threads=1, chunk=16)
    table, motors = folder / "samples.csv", folder / "motors.csv"
    motors.write_text("joint,peak [N m]\nslide,50\n")
    table.write_text("t [s],q x [m],q y [rad]\n0,0.1,0.2\n1,0.3,0.5\n", encoding="utf-8")
    excited = rd.tools.identify.excite(robot, 5.0, limits={"velocity": 2.0}, starts=1, compare_longer=False)
    states = np.random.default_rng(0).uniform(-1, 1, (12, 2))
    t = np.linspace(0.0, 5.0, 1001)
    moved, *rates = excited.reference.at(t)
    current = robot.inverse_dynamics(moved, *rates) + rates[0] + np.random.default_rng(0).normal(0, 0.1, (1001, 2))
    log = {"t": t, "q": moved, "current": current}
    needs = rd.tools.motors.budget(rd.control.quintic(q, v, 1.0), plant, effort=50.0, velocity=4.0)
    adaptive = rd.integrate.Adaptive()
    arms = rd.tools.step.Stepper(plant, 2)
    arms.reset(q)
    task: dict[str, Any] = {
        "start": lambda rng: (q, v), "reward": lambda state, action, goal: np.ones(len(state.q)), "low": [-9.0, -1.0],
        "high": 9.0, "time_limit_s": 1.0, "terminated": lambda state, goal: state.q[:, 0] > 9.0,
        "goal": lambda rng: rng.normal(size=2), "observe": lambda state, goal: state.q,
    }  # fmt: skip
    learning = rd.tools.step.VectorEnv(rd.tools.step.Stepper(plant, 2), **task)
    single = rd.tools.step.Env(rd.tools.step.Stepper(plant, 1), **task)
    system = System(lambda t, y: -y, 1)
    given = {"q": q, "v": v, "a": u, "tau": u}
    made: dict[str, Example] = {
        f"{kind}.{method}": (
            getattr(dynamics, method),
            {name: given[name] for name in names} | ({"frame": "pole"} if method in FRAMED else {}),
        )
        for kind, dynamics in (("Robot", robot), ("Lagrangian", own))
        for method, names in ARGUMENTS.items()
    }
    for kind, dynamics in (("Robot", robot), ("Lagrangian", own)):
        for method in ("jacobian", "jacobian_rate"):
            made[f"{kind}.{method}"][1]["expressed_in"] = "body"
        made[f"{kind}.total_energy"] = dynamics.total_energy, {"q": q, "v": v}
    pair = {"model": robot, "reference": hold, "kp": 9.0, "kd": [6.0, 2.0], "period_s": 0.01}
    points, eye = [q, u, v], np.eye(3)
    sampled = rd.control.PD(hold, kp=9.0, kd=6.0, period_s=0.01)
    external = rd.control.external_torque(robot, [0.0, 2.0], [q, q], [v, v], [u, u], bandwidth_rad_s=9.0)
    path: Any = rd.control.line([0.1, 0.2, 0.3], [0.4, 0.2, 0.1], 1.0)
    made |= {thing.__name__: (thing, arguments(thing)) for thing in (*EFFECTS.values(), rd.effects.joint_stops)}
    calls = [
        call(rd.integrate.Adaptive, method="Rodas5P", rtol=1e-8, atol=1e-9, max_step_s=0.5),
        call(adaptive.solve, system=system, t0=0.0, y0=q, t1=1.0, stop=lambda t, y: 1.0),
        call(adaptive.steps, system=system, t0=0.0, y0=q, t1=1.0, stop=lambda t, y: 1.0),
        call(adaptive.with_tolerances, factor=10.0, longest_s=0.5),
        call(rd.accuracy.Ball, bits=53),
        call(rd.compiled, robot_or_plant=robot, dtype="float64", threads=1, cache=False),
        call(rd.control.ComputedTorque, **pair),
        call(rd.control.Differences),
        call(rd.Event, function=lambda t, q, v: 1.0, direction=1, terminal=True, name="high"),
        call(rd.effects.CarriedPayload(rd.Payload("pole", 1.0), 0.5).acts, t=0.1),
        call(rd.effects.ExternalWrench("pole", np.ones(6)).acts, t=0.1),
        call(rd.effects.ExternalWrench("pole", np.ones(6)).at, placement=np.eye(4)),
        call(rd.control.FeedForward, **pair),
        call(rd.control.MomentumObserver, controller=sampled, model=robot, bandwidth_rad_s=9.0, effects=plant.torque),
        call(rd.control.MomentumObserver(sampled, robot, bandwidth_rad_s=9.0).recorded, t=[0.0, 1.0],
            z=np.zeros((2, 9))),
        call(external.block_maxima, block_s=2.0),
        call(external.contacts, threshold=[1.0, 2.0]),
        call(external.threshold, alarms_per_hour=1800.0, block_s=2.0, level=0.9),
        call(rd.control.Loop, controller=sampled, position=[rd.control.Quantisation(1e-3)],
            velocity=[rd.control.Differences()], actuation=[rd.control.RateLimit(9.0)], measurement_delay_periods=1.5,
            actuation_delay_periods=0.5, noise_seed=3, run=1),
        call(rd.control.LowPass, cutoff_rad_s=[9.0, 8.0], order=1),
        call(proven.at, t=0.01),
        call(proven.contains, t=0.01, q=q, v=v),
        call(proven.digits_of, t=run.t, q=run.q),
        call(run.causes),
        call(run.joint_wrenches, frame="pole", at="pole"),
        call(run.proven_digits, proof=proven),
        call(rd.tools.proof.prove, setup=setup, until_s=0.001, bits=53, q0=q, v0=v, width_q=1e-9, width_v=1e-9,
            budget_s=1.0, on_progress=print),
        call(rd.control.Noise, deviation=[0.1, 0.2]),
        call(rd.control.Quantisation, resolution=[0.1, 0.2]),
        call(rd.control.RateLimit, rate=[0.1, 0.2]),
        call(rd.Lagrangian, robot=robot, dtype=np.float32),
        call(own.mass_matrix_derivative, q=q),
        call(rd.control.OperationalSpace, model=robot, frame="pole", reference=path, kp=1.0, kd=[1.0], posture=q,
            posture_kp=1.0, posture_kd=2.0, rows=(0,), threshold=0.01, period_s=0.01),
        call(rd.control.PD, reference=hold, kp=9.0, kd=[6.0, 2.0], period_s=0.01),
        call(rd.control.PDGravity, **pair),
        call(rd.control.PID, reference=hold, kp=9.0, ki=1.0, kd=2.0, effort_limit=3.0, tracking_time_s=0.5,
            period_s=0.01),
        call(rd.Payload, frame="pole", mass=0.5, com=(0.1, 0.2, 0.3), inertia=eye),
        call(rd.control.PiecewisePolynomial, breaks=[0.0, 1.0], coefficients=[[[0.1], [0.2]]]),
        call(hold.at, t=0.1),
        call(rd.Plant, dynamics=robot, effects=[friction]),
        call(plant.C, q=q, v=v, t=0.1),
        call(plant.M, q=q, t=0.1),
        call(plant.N, q=q, v=v, t=0.1),
        call(plant.at, t=0.1),
        call(plant.actuation, u=u),
        call(plant.forward_dynamics, q=q, v=v, u=u, t=0.1),
        call(plant.held_joints, q=q, v=v, u=u, t=0.1),
        call(plant.inverse_dynamics, q=q, v=v, a=u, t=0.1),
        call(plant.torque, q=q, v=v, t=0.1),
        call(rd.Robot, description=robot.description, edits=robot.edits),
        call(robot.announced),
        call(rd.Robot.from_pinocchio, model=robot.model),
        call(rd.Robot.from_text, urdf=robot.description.xml.decode(), source="arm"),
        call(robot.to_urdf, path=folder / "written.urdf"),
        call(robot.random_configuration, rng=np.random.default_rng(0)),
        call(robot.joint_wrenches, q=q, v=v, a=u, external={"pole": np.ones(6)}, frame="pole", at="pole"),
        call(robot.attach, gripper=rd.load("planar_2r"), frame="pole", prefix="g_", xyz=(0, 0.1, 0), rpy=(0.3, 0, 0)),
        call(rd.load("panda").with_soft_limits),
        call(robot.with_, gravity=(1.0, 0.0, -9.0), lock={"hinge": 0.1}, payload=rd.Payload("pole", 1.0),
            armature=0.1, mass_scale=1.1),
        call(several.outcome, run=1),
        call(several.table),
        call(run.table),
        call(several.setup_of, run=1),
        call(rd.control.Samples, t=[0.0, 0.5, 1.0], q=points, v=points, a=points),
        call(rd.control.Samples([0.0, 0.5, 1.0], points).at, t=0.1),
        call(rd.Setup, plant=plant, q0=q, v0=v, duration_s=0.1, controller=rd.control.PD(hold, kp=1.0, kd=1.0),
            method=rd.integrate.method("RK4"), step_s=1e-3, record_every_s=0.01, estimate_error=True,
            metadata={"note": "text"}, engine="interpreted"),
        call(rd.effects.Layer, joint=1, width=0.01, level=0.5, of_velocity=True),
        call(rd.effects.Threshold, joint=1, level=0.5, name="stop", rising="touched", falling="left",
            of_velocity=True),
        call(rd.accuracy.certify, robot=robot, q=q, v=v, a=u, tau=u, samples=100, seed=3, repeats=1,
            on_progress=lambda part, what: None),
        call(rd.accuracy.warn_below, robot=robot, digits=12.0),
        call(certified.digits_of, quantity="M", implementation="Pinocchio"),
        call(certified.save, path=folder / "digits.csv", theme="dark"),
        call(priced.save, path=folder / "cost.csv", theme="dark"),
        call(measured.save, path=folder / "work.csv", theme="dark"),
        call(needs.save, path=folder / "budget.csv", theme="dark"),
        call(rd.diff_runs(several[0], several[0]).save, path=folder / "difference.csv", theme="dark"),
        call(rd.tools.stress.stress(robot, samples=100, runs=0, budget_s=1e-3).save, path=folder / "stress.json",
            theme="dark"),
        call(rd.tools.stress.stress, robot=robot, samples=100, runs=0, seed=3, budget_s=1e-3, on_progress=lambda
            spent, what: None),
        call(rd.tools.doctor.check_urdf, name_or_path="planar_2r", package_dirs=[folder], mass=None, total_mass=None,
            density=1000.0, allow_overlap=False, units=True,
            inertia_unit="kg mm2", xacro=None),
        call(rd.tools.doctor.diff_robots, a=robot, b=robot, joints={"slide": "slide"}, signs={"slide": -1},
            offsets={"hinge": 0.1}, tolerance=0.5, samples=3, seed=3),
        call(rd.control.circle, centre=[0.1, 0.2, 0.3], radius=0.1, normal=[0.0, 0.1, 1.0], period_s=1.0, turns=1.0,
            ramp_s=0.1, toward=[1.0, 0.0, 0.0], rotation=eye, start_s=0.1),
        call(rd.effects.coefficient, unit="N m", symbol="f", shapes=((), ("n",)), minimum=0.5, exclusive_minimum=0.5,
            infinite=False, fill_value=0.5, stated="friction", can_vary=True),
        call(rd.compare, robot=robot, samples=1, seed=3, tolerance=1e-9, on_sample=print_nothing),
        call(rd.euler_lagrange, kinetic=lambda t, q, v: v[0] ** 2 / 2, potential=lambda t, q: ca.cos(q[0]), n=1),
        call(rd.control.from_samples, arm=robot, source={"slide": [0.1, 0.2, 0.3], "hinge": [0.1, 0.3, 0.4]},
            time=[0.0, 1.0, 2.0], joints={"slide": "slide", "hinge": "hinge"}, unit="rad", ends="measured", q0=q,
            start_s=0.5, topic=None),
        call(rd.control.external_torque, arm=robot, t=[0.0, 1.0], q=[q, q], v=[v, v], tau=[u, u], bandwidth_rad_s=9.0,
            effects=plant.torque, rest_s=(0.0, 1.0), zero_order_hold=True),
        call(rd.control.gains_from, inertia_diagonal=[1.0, 2.0], bandwidth_rad_s=3.0, damping_ratio=0.9),
        call(rd.control.hold, q=q),
        call(rd.control.inverse_kinematics, arm=robot, pose=robot.placement(q, "pole"), frame="pole", q0=q, seed=1,
            starts=2, tolerance=1e-9, iterations=5, tool_axis=[0.0, 0.0, 1.0]),
        call(rd.control.line, p0=[0.1, 0.2, 0.3], p1=[0.4, 0.2, 0.1], duration_s=1.0, rotation=eye, rotation_end=eye,
            start_s=0.1),
        call(rd.linearise, plant=plant, q=q, v=v, u=u, z=[], t=0.1),
        call(rd.list_robots),
        call(rd.load, name_or_path=urdf, package_dirs=[folder], xacro=None, inertia="stated", mass=None,
            total_mass=None, density=None, allow_overlap=False, download=False, without=()),
        call(rd.read, path=saved),
        call(rd.diff_runs, a=several[0], b=several[0]),
        call(several.save, path=folder / "table.csv"),
        call(rd.integrate.method, name="RK4"),
        call(rd.accuracy.midpoint, x=rd.Lagrangian(robot, rd.accuracy.Ball(60)).N(q)),
        call(rd.accuracy.radius, x=rd.Lagrangian(robot, rd.accuracy.Ball(60)).N(q)),
        call(rd.plot, run=run, only=["torques"], joints=["hinge"], limits=u, theme="light", style="paper",
            width_mm=120.0),
        call(rd.tools.export.c_source, system=robot, quantities=["N"], dtype="float32", name="arm"),
        call(rd.tools.export.c_source(robot, ["N"]).write, folder=folder / "c", force=True),
        call(rd.tools.export.casadi, arm_or_plant=plant, quantity="N", open_parameters=True),
        call(rd.tools.export.parameter_values, plant=plant),
        call(rd.tools.symbols.symbols, arm=robot, letters="base"),
        call(rd.tools.symbols.symbols(robot).latex),
        call(rd.tools.export.discretise, A=eye, B=np.ones((3, 1)), period_s=0.01, delay_s=0.004),
        call(rd.tools.identify.excite, arm=robot, duration_s=5.0, limits={"velocity": 2.0, "torque": 90.0}, box=None,
            tool=None, fraction=0.9, harmonics=5, noise=0.5, rate_hz=50.0, starts=1, seed=0, compare_longer=False),
        call(rd.tools.identify.Poses, q=states, tau=states, approach=np.ones((12, 2))),
        call(rd.tools.identify.static, arm=robot, poses=rd.tools.identify.Poses(states, robot.N(states)), friction=0.5,
            noise=0.1, tilt=False),
        call(excited.save, path=folder / "excitation.csv"),
        call(rd.tools.identify.Experiment((("mass", "gain"),), np.ones(1), np.ones(1), states, excited.plan).save,
            path=folder / "motion.csv"),
        call(rd.tools.identify.identify, arm=robot, log=log, reference=excited.reference, repeat=None, gains=1.0,
            effects=[rd.effects.ViscousFriction(0.1)], cutoff_hz=6.0, slow=0.05),
        call(rd.tools.identify.payload, arm=robot, log=log, empty=log, link="pole", reference=excited.reference,
            gains=1.0, cutoff_hz=6.0, slow=0.05),
        call(rd.tools.identify.identify(robot, log, gains=1.0).save, path=folder / "arm.urdf"),
        call(rd.tools.motors.path, plant=robot, points=[q, v], fraction=0.9, effort=50.0, velocity=4.0,
            acceleration=30.0, motors=None),
        call(rd.tools.motors.budget, motion=rd.control.quintic(q, v, 1.0), plant=plant, payload=rd.Payload("pole",
            0.5), motors=None, effort=50.0, velocity=4.0, continuous=u),
        call(rd.tools.motors.max_payload, motor_budget=needs, link="pole", com=[0.1, 0.2, 0.3]),
        call(rd.tools.motors.fastest, motor_budget=needs, fraction=0.9),
        call(rd.tools.motors.read_motors, path=motors),
        call(rd.tools.motors.point_to_point, arm=robot, q0=q, q1=v, acceleration=1.0, jerk=9.0, velocity=u, v0=0.1,
            v1=0.0, start_s=0.1),
        call(rd.control.quintic, q0=q, q1=v, duration_s=1.0, start_s=0.1, v0=0.1, v1=u, a0=u, a1=0.0),
        call(rd.read_scene, path=scene, effects={"own": rd.effects.Spring}),
        call(rd.replay, run=run, package_dirs=[folder], frame="pole", inertia=True, names=["swing"]),
        call(rd.rollouts, system=setup, q0=[q, u], v0=[v, u], vary={"viscous_friction.viscous": [0.1, 0.2]},
            record=("q",), uncut=True, numbers=[3, 1], threads=1, max_bytes=10**9),
        call(rd.tools.step.Stepper, plant=plant, n=2, period_s=0.02, controller=sampled, step_s=2e-3, method="RK4",
            vary={"kp": [8.0, 9.0]}, uncut=True, ledger=True, threads=1),
        call(arms.reset, q=q, v=v, mask=[True, False]),
        call(arms.step, action=[u, u]),
        call(arms.set_state, state=arms.state, mask=[True, False]),
        call(rd.tools.step.VectorEnv, stepper=arms, **task),
        call(learning.reset, seed=3),
        call(learning.step, actions=[u / 2, u / 2]),
        call(rd.tools.step.Env, stepper=rd.tools.step.Stepper(plant, 1), **task),
        call(single.reset, seed=3),
        call(single.step, action=u / 2),
        call(rd.tools.sweeps.Sweep, scene=scene, runs=8, vary={"q0": rd.tools.sweeps.uniform(low=[0.1, 0.2],
            high=0.3)}, figures={"peak": rd.tools.sweeps.peak("v")}, design="random", seed=1),
        call(swept.sweep.values, start=0, stop=3),
        call(swept.save, path=folder / "rows.csv", force=True),
        call(swept.mean, figure="end", level=0.9, condition="finished"),
        call(swept.probability, event="end > 0.1", level=0.9, condition="finished"),
        call(swept.quantiles, figure="end", probabilities=[0.5], level=0.9),
        call(swept.reasons),
        call(swept.run, i=3),
        call(swept.setup_of, i=3),
        call(swept.sensitivity, figure="end", level=0.9, condition="finished"),
        call(swept.verify),
        call(swept.worst, figure="end", count=2, condition="finished"),
        call(rd.tools.sweeps.choice, values=[1.0, 2.0]),
        call(rd.tools.sweeps.final, quantity="q", joint="slide"),
        call(rd.tools.sweeps.from_scene, path=of_sweep, vary={}, figures={"end": rd.tools.sweeps.final("q",
            "slide")}),
        call(rd.control.orientation_error, R_desired=eye, R=eye),
        call(rd.control.rotation_vector, R=eye),
        call(rd.tools.sweeps.lognormal, median=1.0, sigma_of_log=0.1),
        call(rd.tools.sweeps.normal, mean=1.0, sd=0.1),
        call(rd.tools.sweeps.peak, quantity="v", joint="slide"),
        call(rd.tools.sweeps.read_sweep, folder=folder / "sweep", scene=of_sweep, figures={}),
        call(rd.tools.sweeps.rms_tracking_error, joint="slide"),
        call(rd.tools.sweeps.run, sweep=swept.sweep, folder=folder / "sweep", threads=1, chunk=16,
            on_progress=print_nothing),
        call(rd.tools.sweeps.triangular, low=0.0, mode=0.5, high=1.0),
        call(rd.tools.sweeps.uniform, low=0.0, high=1.0),
        call(run.save, path=folder / "again"),
        call(rd.show, robot=robot, q=q, package_dirs=[folder], inertia=False),
        call(rd.simulate, system=plant, on_progress=lambda t: None, q0=q, duration_s=0.01),
        call(rd.control.task_dynamics, dynamics=robot, q=q, v=v, frame="pole", rows=(0,), threshold=0.01),
        call(rd.why, plant=plant, q=q, v=v, a=u, joint="hinge", t=0.1),
        call(rd.explain, system=setup),
        call(rd.info, robot=robot),
        call(rd.parameters, system=setup),
        call(rd.advise, system=plant, q0=q, v0=v, duration_s=0.01),
        call(priced.comparison, name="gravity"),
        call(rd.accuracy.cost, system=setup, q0=q, v0=v, budget_s=1e-9, repeats=1, on_progress=print_nothing),
        call(measured.digits, error=1e-6),
        call(measured.sentence_of, digits=6),
        call(rd.accuracy.work_precision, system=replace(setup, engine="interpreted"), q0=q, v0=v, duration_s=0.01,
            methods=["RK4"], peers=False, budget_s=2.0, repeats=1, on_progress=print_nothing),
        call(rd.control.via_points, times_s=[0.0, 0.5, 1.0], points=points, kind="cubic"),
    ]  # fmt: skip
    named: dict[str, Example] = {  # whose first argument is by position
        "digits": (
            lambda robot, quantity, q: rd.accuracy.digits(robot, quantity, q),
            {"robot": robot, "quantity": "N", "q": q},
        ),
        "SweepResult.table": (lambda names: swept.table(names), {"names": "end"}),
        "samples": (partial(rd.tools.sweeps.samples, "q"), {"every": 3, "failed": True}),
    }
    return made | named | dict(calls)


def call(function: Callable[..., Any], /, **arguments: Any) -> tuple[str, Example]:
    """The name of a function or a class, or of a method after that of its class, and a call of it."""
    owner = getattr(function, "__self__", None)
    kind = owner if isclass(owner) else type(owner)
    name = function.__qualname__ if owner is None else f"{kind.__name__}.{function.__name__}"
    return name, (function, arguments)


def print_nothing(*_: object) -> None:
    """A function of anything."""


def wrong(name: str, function: Callable[..., Any], argument: str, value: Any) -> Iterator[Any]:
    """What is not of the kind of a valid value."""
    kinds = ((bool, NOT_OBJECTS), (int, NOT_WHOLE), (str, NOT_TEXT), (float | np.ndarray | list | tuple, NOT_NUMBERS))
    candidates = next((each for kind, each in kinds if isinstance(value, kind)), NOT_OBJECTS)
    if isinstance(value, list | tuple) and not all(isinstance(x, float | np.ndarray | list | int) for x in value):
        candidates = NOT_OBJECTS
    if isinstance(value, Path):
        candidates = [each for each in candidates if not isinstance(each, str)]
    if callable(value):
        candidates = [each for each in candidates if not callable(each)]
    parameter = signature(function).parameters.get(argument)
    for each in candidates:
        if each is None and (parameter is None or parameter.default is None or "None" in str(parameter.annotation)):
            continue
        if each is True and isinstance(value, bool):
            continue
        yield each
    if argument in SIGNED.get(name, ()):
        yield -1.0
