"""Descriptions from other packages, read only on request.

mjcf, mjcf_model, mjcf_actuators, mjcf_shapes  MJCF as MuJoCo compiles it, as a URDF
xacro                                          the URDF that a file of macros expands to
robot_descriptions                             robots of the package of that name
"""
