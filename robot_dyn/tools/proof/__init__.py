"""Proven runs: enclosures of the flow ẋ = f(t, x) in ball arithmetic, for the numbers stated by a file.

    prove    a theorem (Proof) about the motion of a setup

proven_run  proof step by step, as long as every bound holds
theorem     result of a proof; node: stored data of a step
motion      setups that theorems support
hypotheses  the start, and the exact numbers assumed
term, tape  the equation of motion as a program in balls, by a trace without rounding
enclosure/  one proven step
command     the command `prove`
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
