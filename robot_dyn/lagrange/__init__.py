"""Where the equations come from: M(q) a + C(q, v) v + N = Υ out of K − V, in any arithmetic."""
