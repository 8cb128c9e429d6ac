"""The engines of a run: what evaluates its state equation and takes its steps, machine code or Python.

- choice: machine code or Python for a setup, by a count of evaluations.
- interpreted: the state equation as Python functions for a time loop.
- structure: what machine code depends on besides parameters; trace: the equation in symbols; programs: both, stored.
- cache: from a state equation to a `CompiledStateEquation` (machine_code), cached by structure.
- functions: its functions as programs and addresses; loop: the time loops, one for each method.
- self_check: the comparison with the interpreted equation before use.
"""
