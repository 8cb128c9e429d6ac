"""One run: its loops, plain functions that run interpreted or as machine code, and the class `Run`, which calls them.

- `run`: the run of a setup; `runner`: companion runs of an error estimate; `state`: the data of a run in progress
- `outcome`: how a run ends or gives up
- `time_loop`, `fixed_steps`: steps of fixed length, the loop for one run or many in lock step, and its calls
- `event_loop`, `event_steps`, `event_handler`: steps that are chosen or end at events, the loop, its calls, the events
- `recording`: what both loops record, and its result
- `watch`: when a run has diverged; `stiffness`: where stability bounds the steps, and another method is faster
- `philox`: noise by number
"""
