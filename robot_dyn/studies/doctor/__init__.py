"""The doctor of robot descriptions: what is wrong or doubtful in a URDF file, and what can be repaired."""
