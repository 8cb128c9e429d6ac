"""Stored machine code: keys of all its dependencies, the definition of user code in them, and the folder (cache)."""
