"""Many runs of one setup at once."""
