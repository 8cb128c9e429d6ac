"""Engines: they evaluate the state equation of a run.

- engine: the protocol `Engine`, with the functions that a time loop calls; interpreted: the engine in Python.
- choice: the engine of a setup; machine code (`compiled/`) is a plug-in that a run does not import.
"""
