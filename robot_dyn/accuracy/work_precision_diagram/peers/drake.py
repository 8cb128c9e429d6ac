"""Drake's error-controlled runge_kutta3, from the same file by its own parser."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.accuracy.work_precision_diagram.method_under_test import Limit, MethodUnderTest, Run, tolerances
from robot_dyn.accuracy.work_precision_diagram.peers.arm_motion import ArmMotion, PeerError, bare_urdf


def methods_under_test(motion: ArmMotion) -> list[MethodUnderTest]:
    """Return Drake's default method at increasing accuracy."""
    framework, parsing, tree, analysis, mathematics = (
        import_module(f"pydrake.{name}")
        for name in ("systems.framework", "multibody.parsing", "multibody.plant", "systems.analysis", "math")
    )
    robot, setup, n = motion.robot, motion.setup, motion.robot.n
    builder: Any = framework.DiagramBuilder()
    plant = builder.AddSystem(tree.MultibodyPlant(time_step=0.0))
    try:
        text = etree.tostring(bare_urdf(robot), encoding="unicode")
        parsing.Parser(plant).AddModelsFromString(text, "urdf")
        root = next(iter(robot.frame_names))
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root), mathematics.RigidTransform())
        plant.mutable_gravity_field().set_gravity_vector(np.array(robot.edits.gravity))
        plant.Finalize()
    except (RuntimeError, ValueError) as error:
        raise PeerError(f"it cannot read the file: {' '.join(str(error).split())[:200]}") from None
    if plant.num_positions() != n:
        raise PeerError(f"it reads {plant.num_positions()} joints from the file, not {n}")
    places = [plant.GetJointByName(name).position_start() for name in robot.joint_names]
    diagram = builder.Build()
    own_context = plant.CreateDefaultContext()

    def set_state(context: Any, q: np.ndarray, v: np.ndarray) -> None:
        x = np.empty(2 * n)
        x[places], x[n + np.array(places)] = q, v
        plant.SetPositionsAndVelocities(context, x)

    def mass_matrix(q: np.ndarray) -> np.ndarray:
        set_state(own_context, q, np.zeros(n))
        return plant.CalcMassMatrix(own_context)[np.ix_(places, places)]

    def bias(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        set_state(own_context, q, v)
        return (plant.CalcBiasTerm(own_context) - plant.CalcGravityGeneralizedForces(own_context))[places]

    motion.check(mass_matrix, bias, motion.torque)

    def run(accuracy: float, limit: Limit) -> Run:
        simulator: Any = analysis.Simulator(diagram)
        analysis.ResetIntegratorFromFlags(simulator, "runge_kutta3", 0.1)
        integrator = simulator.get_mutable_integrator()
        integrator.set_target_accuracy(accuracy)
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        set_state(context, setup.q0, setup.v0)
        simulator.Initialize()

        def advance(t: float) -> tuple[np.ndarray, np.ndarray]:
            simulator.AdvanceTo(t)
            return plant.GetPositions(context)[places], plant.GetVelocities(context)[places]

        q, v, spent = motion.recorded(advance, limit)
        evaluations = integrator.get_num_derivative_evaluations()
        return motion.run(q, v, integrator.get_num_steps_taken(), evaluations, spent)

    return [MethodUnderTest("Drake runge_kutta3", "", True, 3, "tolerance", tolerances, run)]
