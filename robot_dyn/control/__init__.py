"""Torque from a reference and a measured state: each controller has its own model of the arm, not the plant.

    joint by joint     PD, PID; gains_from: gains from a bandwidth and a damping ratio
    with a model       ComputedTorque, PDGravity, FeedForward
    of a frame         OperationalSpace; task_dynamics (TaskDynamics), orientation_error, rotation_vector
    a function         ControlLaw: (t, q, v) as a controller
    joint motions      quintic, via_points, hold (PiecewisePolynomial), Samples
    recorded motions   from_samples: from files, data frames, logs and arrays (Plan)
    motions of a frame line, circle (CartesianReference); inverse_kinematics (InverseKinematics)
    external torque    MomentumObserver; external_torque (ExternalTorque, Contact, AlarmThreshold)
    a real loop        Loop with delays and blocks: Quantisation, Differences, LowPass, RateLimit, Noise
    to write one       Controller, Stateless, Block, Reference: base classes

docs/developers/extending.md writes a controller step by step; robot_dyn/control/README.md lists its files.
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
