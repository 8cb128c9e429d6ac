"""Settings of the whole suite."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

# Wall time says nothing about correctness on a shared machine, and a failure must come again.
settings.register_profile(
    "robot_dyn", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
settings.load_profile("robot_dyn")
