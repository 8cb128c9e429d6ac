"""The engine of machine code: a plug-in of `engine/`.

- choice: machine code for a setup or a batch if it is worthwhile, by a count of evaluations.
- machine_code: the engine; self_check: its comparison with the interpreted engine before its first use.
- cache: machine code in this process and in the store; structure: the key; trace: the equation in symbols.
- loop: the time loops as machine code, one for each method.
"""
