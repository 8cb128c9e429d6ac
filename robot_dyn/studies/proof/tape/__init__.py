"""The equation of motion as a program in balls: a trace that rounds nothing."""
