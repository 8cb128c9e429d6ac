"""Proven runs: enclosures of the flow ẋ = f(t, x), in ball arithmetic, of the numbers that a file states."""
