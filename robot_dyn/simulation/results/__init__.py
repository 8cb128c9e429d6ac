"""The result of a run, and its file.

- run_data: the table of quantities and the fields of a run, which plots, tables and files of runs use.
- trajectory: `Trajectory`; statistics: cost of a run; summary and table: its text and its columns.
- samples: acceleration, actuation, power, energy and tracking error from states; ledger: energy and work.
- causes: actuation of each joint by inertia, Coriolis, gravity and effect; joint_wrenches: wrenches through its joints.
- error_estimate: the estimated error and its verdict.
- doubts: reasons for an estimate that ends early or a ledger that does not close, their onset and their sentences.
- acting: effects by name, wrenches on links, stops in contact.
- provenance: the origin of a run as texts, from which its robot is rebuilt.
- run_file: run files, written by `foundations/store.py`; formats: the formats of `save`, by suffix.
"""
