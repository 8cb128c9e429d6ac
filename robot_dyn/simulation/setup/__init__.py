"""The setup of a run.

- setup: `Setup`: plant, start, controller, method, duration; options: its attributes as keyword arguments.
- checks: whether its parts fit each other and the method; size: its steps, samples and memory, before it runs.
- explanation: what a setup integrates, in words.
- schedule: segments between ticks and switches, and the steps on each; segment_table: the same as arrays.
"""
