"""The setup of a run.

- setup: `Setup`: plant, start, controller, method, duration; its steps, samples and memory.
- options: the attributes of a setup as keyword arguments.
- checks: errors for parts that do not fit each other or the method.
- explanation: the control of a setup, in words; settings: the numbers of a setup, by name.
- schedule: segments between ticks and switches, and the steps on each; segment_table: the same as arrays.
"""
