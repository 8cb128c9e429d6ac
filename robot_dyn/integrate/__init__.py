"""Methods for y' = f(t, y), one family a file; they know no robot. `method("RK4")` finds one by name.

    by name            method; `method="RK4"` of `rd.simulate` takes the same names
    chosen steps       Adaptive: DOP853, Rodas5P or auto, within a tolerance
    fixed steps        ExplicitRungeKutta, SemiImplicitEuler, GaussLegendre
    stiff, fixed steps Rosenbrock
    with impacts       MoreauJean
    to write one       ButcherTableau, RosenbrockTable, Surd: coefficients as data
                       Integrator, PlainMethod: base classes; Stepper, System, RightSide
    what they return   Solution, Status; IntegrationError

docs/developers/extending.md adds a method step by step; robot_dyn/integrate/README.md lists its files.
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
