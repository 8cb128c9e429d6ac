"""Methods for y' = f(t, y), one family a file; they know no robot. `method("rk4")` finds one by name.

The public names are those of `__init__.pyi`, imported when first used.

    integrator                     base classes: `Integrator`, `PlainMethod`; the equation, `System`
    methods                        the list of methods by name
    explicit, gauss, implicit, rosenbrock, time_stepping    the families with fixed steps
    adaptive, dop853, step_control, controlled_steps        methods that choose their steps
    tableau, rosenbrock_table      coefficients as data
    primitives, fixed_point, differences                    what steps are made of
    hermite, bernstein             dense output, and where it passes a level
"""

from robot_dyn.public import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
