"""Effects on the joints besides actuation: torques and bounds on the actuation, summed by a `Plant`.

    friction           ViscousFriction, RegularisedCoulombFriction, DryFriction, LuGreFriction, DahlFriction
    stops and springs  joint_stops (JointStopSpring, JointStopDamper), RigidStops, Spring
                       LineSpringDamper (LineSpring, LineDamper): between two points
    drives             EffortLimit, TorqueSpeedLimit, ActuatorLag, SeriesElastic, RigidBacklash
    loads              ExternalWrench, CarriedPayload
    to write one       Conservative, Dissipative, Active, Bound, Stateful, Drive, SetValued: base classes of Effect
                       coefficient, Threshold, Layer: declarations of an effect; Dynamics: its first argument
    used with effects  Plant, EquationOfMotion, Force, HeldJoint, Interval, Mode

docs/developers/extending.md writes an effect step by step; robot_dyn/effects/README.md lists its files.
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
