"""Remarks on a run: what its samples need not show, each with what to do.

- step_remarks: what was observed at every step: chatter, limits and stops, a coarse record, effects that gain energy,
  joints that creep under regularised friction.
- reference_remarks: a reference that jumps at its start, or moves a joint that friction holds.
- damped_task, unstable_loop: singular tasks, sampled loops.
- imbalance: why the energy ledger does not close; missed_events: what acted between the ends of two steps.
- smoothness: where the right-hand side of a run is smooth, and where it may not be.
"""
