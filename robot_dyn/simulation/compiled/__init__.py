"""The state equation and the time loops as machine code.

- engine_choice: machine code or Python for a setup, by a count of evaluations.
- structure: what machine code depends on besides parameters; trace: the equation in symbols; programs: both, stored.
- build: from a state equation to a `CompiledStateEquation` (compiled_state_equation), cached by structure.
- functions: its functions as programs and addresses; loop: the time loops, one for each method.
- self_check: the comparison with the interpreted equation before use.
"""
