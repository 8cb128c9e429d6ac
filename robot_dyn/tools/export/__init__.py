"""Export: the equations of an arm and the ticks of controllers for other programs: C, CasADi, discrete-time models.

    c_source      C of M, C, N, inverse and forward dynamics, or of a tick, with a self-test, a CSource
    CSource       the files, with the errors of each function, a CFunction
    casadi        a quantity as a casadi.Function; parameter_values: values of its argument p
    discretise    A and B of a sampled model with an input delay, a SampledModel

docs/how_to/ has examples (c_for_a_controller, controller_in_c, optimal_control, observers_and_lqg), and README.md lists
the files of this folder.
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
