"""A run as machine code: its motion traced, its march compiled, and held to the interpreted engine before use."""
