"""The engine of machine code: a plug-in of `engine/`.

- choice: the engine for a setup or a batch: machine code if it saves time, by a count of evaluations.
- machine_code: the engine; self_check: its comparison with the interpreted engine before its first use.
- cache: machine code in this process and in the store; structure: its key; trace: the equation in symbols.
- loop: the time loops as machine code, one for each method.
"""
