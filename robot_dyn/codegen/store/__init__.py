"""Stored machine code: keys of all that it depends on, the definition of user code in them, the folder (cache)."""
