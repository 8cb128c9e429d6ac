"""One run: its loops, plain functions that run interpreted or as machine code, and the class `Run`, which calls them.

- `run`: the run of a setup; `runner`: companion runs of an error estimate; `state`: the data of a run in progress
- `outcome`: the reason for which a run ends or gives up
- `time_loop`, `fixed_steps`: steps of fixed length, the loop for one run or many in lock step, and its calls
- `event_loop`, `event_steps`, `event_handler`: steps that are chosen or end at events, the loop, its calls, the events
- `recording`: the records of both loops, and the recording of a run
- `watch`: detection of divergence; `stiffness`: detection of steps that stability limits
- `philox`: noise as a function of a counter
"""
