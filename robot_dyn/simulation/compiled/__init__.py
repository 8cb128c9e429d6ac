"""The state equation and time loops as machine code."""
