"""Torque from a reference and a measured state: each controller owns its model of the arm and never sees the plant.

The public names are those of `__init__.pyi`, imported when first used.

    controller                         base classes: `Controller`, `Stateless`; controllers inside others
    independent_joint                  `PD`, `PID`
    computed_torque                    controllers with a model: `ComputedTorque`, `PDGravity`, `FeedForward`
    operational_space, orientation     control of a frame: `OperationalSpace`, `task_dynamics`
    control_law                        a function (t, q, v) as a controller
    reference, samples                 motions of joints: `quintic`, `via_points`, `hold`, `Samples`
    cartesian                          motions of a frame: `line`, `circle`
    digital_loop/                      what a real loop adds: delays, rounding, filters, noise, two rates
"""

from robot_dyn.public import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
