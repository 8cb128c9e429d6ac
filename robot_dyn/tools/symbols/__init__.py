"""Symbols: the equations of an arm as formulas, to read and to print in LaTeX (extra `symbols`).

    symbols             M, C and N in letters or numbers, a SymbolicEquations
    SymbolicEquations   SymPy matrices, LaTeX; each letter has a Meaning, each rounded angle is a RoundedAngle

docs/how_to/print_the_equations.md is an example.
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
