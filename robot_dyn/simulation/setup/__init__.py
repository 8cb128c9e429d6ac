"""The setup of a run.

- setup: `Setup`: plant, start, controller, method, duration; its steps, samples and memory.
- options: the attributes of a setup as keyword arguments.
- checks: whether its parts fit each other and the method.
- explanation: what a setup integrates, in words.
- schedule: segments between ticks and switches, and the steps on each; segment_table: the same as arrays.
"""
