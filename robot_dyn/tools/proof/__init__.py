"""Proven runs: enclosures of the flow ẋ = f(t, x), in ball arithmetic, of the numbers that a file states.

prove       the study: step by step, as long as every bound holds
theorem     its result; node: what it stores of a step
motion      which setups a theorem can be about
hypotheses  the start, and which numbers are meant
term, tape  the equation of motion as a program in balls, by a trace that rounds nothing
enclosure/  one proven step
"""
