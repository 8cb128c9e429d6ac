"""A run as machine code: state equation traced, time loop compiled, compared with the interpreted engine before use."""
