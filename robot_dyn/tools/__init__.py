"""Tools: separate products, which use the library as a user would.

    doctor   faults of a URDF file, and repairs
    identify parameters of an arm from its motion, and motions that show them
    motors   plans, and whether the motors suffice for them
    sweeps   many runs of a scene under uncertain parameters
    proof    theorems about where an arm will be
    stress   what breaks first on an arm
    export   the equations in C and CasADi, and discrete models
    symbols  the equations of an arm as formulas
    step     many arms that advance together, with an action for each

A tool imports names that a folder of the core lists in its `__init__.pyi`, with the exceptions in
tests/test_tree.py. No other folder of the package imports a tool, and no tool imports another. Their commands and
scene tables are entry points (`robot_dyn.commands`, `robot_dyn.scene_tables` in pyproject.toml), imported when they are
used.
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
