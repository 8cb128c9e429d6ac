"""The result of a run, and its file.

- run_data: the table of quantities and the fields of a run, which plots, tables and files of runs use.
- trajectory: `Trajectory`; statistics: cost of a run; summary and table: its text and its columns.
- samples: acceleration, actuation, power, energy and tracking error from states; ledger: energy and work.
- causes: actuation of each joint by inertia, Coriolis, gravity and effect; joint_wrenches: wrenches through its joints.
- error_estimate: the estimated error and its verdict.
- doubts: the reasons why an estimate ends early or a ledger does not close, and their wording.
- acting: effects by name, wrenches on links, stops that joints bear on.
- provenance: texts from which the robot of a run is built again.
- run_file: run files, written by `foundations/store.py`; formats: what `save` writes, by suffix.
"""
