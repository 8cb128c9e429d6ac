"""Methods for y' = f(t, y), one family a file; they know no robot. `method("rk4")` finds one by name.

    by name            method; `method="rk4"` of `rd.simulate` takes the same names
    chosen steps       Adaptive: DOP853, Radau and others, within a tolerance
    fixed steps        ExplicitRungeKutta, SemiImplicitEuler, Gauss
    stiff, fixed steps Rosenbrock
    with impacts       TimeStepping
    to write one       ButcherTableau, RosenbrockTable, Surd: coefficients as data
                       Integrator, PlainMethod: base classes; Stepper, System, RightSide
    what they return   Solution, Status; IntegrationError

docs/developers/extending.md adds a method step by step; robot_dyn/integrate/README.md lists its files.
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
