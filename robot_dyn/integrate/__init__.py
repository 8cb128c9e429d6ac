"""Methods for y' = f(t, y), one family per file, independent of robots. `method("RK4")` returns a method by name.

    by name            method; `method="RK4"` of `rd.simulate` takes the same names
    error control      Adaptive: DOP853, Rodas5P or auto, within a tolerance
    fixed steps        ExplicitRungeKutta, SemiImplicitEuler, GaussLegendre
    stiff, fixed steps Rosenbrock
    with impacts       MoreauJean
    to write one       ButcherTableau, RosenbrockTable, Surd: coefficients as data
                       Integrator, PlainMethod: base classes; FixedStepper, System, RightSide
    results            Solution, Status; IntegrationError

docs/developers/extending.md adds a method step by step; robot_dyn/integrate/README.md lists its files.
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
