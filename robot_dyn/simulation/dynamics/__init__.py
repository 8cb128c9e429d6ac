"""The equation that a run integrates, and what follows from it without a run.

- `state_equation`: y' = f(t, y) of a plant under a controller; `bodies`, `moreau_jean`: its forms for impacts
- `loop_state`: the arrays on which loops work
- `linearise`, `fastest_motion`, `stability`, `sampled_loop`: linear models, eigenvalues, stable steps and periods
- `smooth_differences`: derivatives at the step that errs least
- `smoothness`, `declarations`: where the right-hand side is smooth, and what parts declare about it
"""
