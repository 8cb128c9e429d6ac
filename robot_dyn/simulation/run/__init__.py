"""One run: its loops in plain functions, which run interpreted or as machine code, and the drivers that call them.

- `make_run`: the run of a setup, in the loop that it needs
- `driver`: what the drivers of both loops share; `outcome`: how a run ends or gives up
- `time_loop`, `fixed_step`: steps of fixed length, one run or many in lock step, and the driver of one
- `event_loop`, `event_run`, `switched_run`: steps that are chosen or cut at events, and the driver
- `recording`: what both loops record, and its result
- `watch`: when a run has diverged; `stiffness`: where stability bounds the steps, and another method is faster
- `philox`: noise by number
"""
