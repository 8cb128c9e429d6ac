"""Remarks on a run: events that its samples may not show, each with a remedy.

- step_remarks: observations at every step: chatter, limits and stops, a coarse record, effects that gain energy,
  joints that creep under regularised friction.
- reference_remarks: a reference that jumps at its start, or moves a joint that friction holds.
- damped_task, unstable_loop: singular tasks, sampled loops.
- runaway, stiff_motion: implausible speeds, steps limited by stability, and runs that another method continued.
- imbalance: the cause of an energy ledger that does not close; missed_events: torques between the ends of two steps.
- smoothness: kinks of the right-hand side along a run.
"""
