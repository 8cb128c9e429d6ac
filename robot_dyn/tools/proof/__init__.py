"""Proven runs: enclosures of the flow ẋ = f(t, x), in ball arithmetic, of the numbers that a file states.

    prove    where the arm of a setup will be, as a theorem (Proof)

proven_run  step by step, as long as every bound holds
theorem     its result; node: what it stores of a step
motion      which setups a theorem can be about
hypotheses  the start, and which numbers are meant
term, tape  the equation of motion as a program in balls, by a trace that rounds nothing
enclosure/  one proven step
command     the command `prove`
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
