"""Types of llvmlite, which has none: the parts that robot_dyn uses."""

__version__: str
