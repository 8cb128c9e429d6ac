"""Events within steps: where switching functions vanish, and the equation and the state after them.

- `event_table`, `detection`, `first_event`: the switching functions, and where one changes sign in a step
- `switching`, `regions`: thresholds of the parts, and the equation between them, in Python and in the loop
- `contacts`, `contact_mode`: joints held by dry friction, rigid stops or backlash, in Python and in the loop
- `mode_change`, `impacts`: the end of a contact mode, and impacts
- `payload_events`: payloads picked up and dropped
- `event_log`: the events in the loop
"""
