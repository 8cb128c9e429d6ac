"""The engines of a run: its state equation in Python, or as machine code.

- engine: the protocol `Engine`, with the functions that a time loop calls; interpreted, machine_code: both engines.
- choice: one of them for a setup; machine code is a plug-in, which a run does not import.
- compiled: machine code if it is worthwhile, by a count of evaluations; self_check: compared with Python before use.
- cache: machine code in this process and in the store; structure: the key; trace: the equation in symbols.
- loop: the time loops as machine code, one for each method.
"""
