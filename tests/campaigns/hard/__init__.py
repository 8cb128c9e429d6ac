"""Hard cases: what rounding, stiffness and singularities may cost, and that what cannot be held is said."""
