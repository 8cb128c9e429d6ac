"""Events within steps: where switching functions vanish, and the equation and the state behind them.

- `detection`, `crossings`, `first_event`: whether and where a switching function changes sign in a step
- `switching`, `sides`: thresholds of the parts, and the equation on either side, in Python and in the loop
- `modes`, `holding`: what holds joints (dry friction, rigid stops, backlash), in Python and in the loop
- `mode_change`, `impacts`: the end of a mode, and impacts
- `payload_events`: payloads picked up and dropped
- `event_log`: what happened, in the loop
"""
