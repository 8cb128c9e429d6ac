"""The setup of a run: plant, start, controller, method, duration; what it is checked for, and its segments."""
