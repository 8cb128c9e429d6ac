"""The equation that a run integrates, and its linear models.

- `state_equation`: y' = f(t, y) of a plant under a controller; `moreau_jean`: its form for time stepping
- `loop_state`: the arrays on which loops work
- `linearise`, `fastest_motion`, `stability`, `sampled_loop`: linear models, eigenvalues, stable steps and periods
- `smooth_differences`: derivatives by differences at the most accurate step
- `declarations`: declarations of parts about where they switch; `event`: events of users, and events of a run
"""
