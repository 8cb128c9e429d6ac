"""Methods for y' = f(t, y), one family a file; they know no robot. `methods.method(name)` finds one by name."""
