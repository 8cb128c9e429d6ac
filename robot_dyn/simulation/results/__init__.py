"""The result of a run, and its file.

- run_data: the table of quantities and the fields of a run, which all that draws, tabulates and stores runs imports.
- trajectory: `Trajectory`; statistics: what it took; summary and table: its text and its columns.
- samples: what follows from states: acceleration, actuation, power, energy, tracking error; ledger: energy and work.
- causes: the actuation of each joint by inertia, Coriolis, gravity and effect.
- error_estimate: the estimated error and its verdict.
- acting: what acts: names, wrenches on links, stops that joints bear on.
- provenance: texts from which the robot of a run is built again.
- run_file: run files, written by `foundations/store.py`; formats: what `save` writes, by suffix.
"""
