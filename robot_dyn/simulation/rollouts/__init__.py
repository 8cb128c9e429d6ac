"""Many runs of one setup, side by side.

- rollouts: the function `rollouts`, its arguments, and the choice between the two ways of running a batch.
- batch: starts and values that differ from run to run, and the record of the runs; thresholds: levels at which runs in
  lock step would need cut steps.
- lock_step: 64 runs per tile in machine code; one_by_one: runs one after the other on each thread; pool: the threads.
- comparison: how far uncut runs are from runs with cut steps, on a random sample.
- rollouts_data: the fields of `Rollouts`, and causes of divergence; result: `Rollouts`; run: one of its runs as a
  `Trajectory`; overview: remarks and tracking errors; table: its table.
- parameters: the parameters that may differ from run to run; run_file: run files of batches; read: the function `read`.
"""
