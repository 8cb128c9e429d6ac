"""Seeing: the geometry of a robot, the replay page in the browser, and plots."""
