"""Step: many arms that advance together, a period at a time, with an action for each.

    Stepper      n lanes of one plant: reset, step, state, set_state
    State        time, q, v and other states of all lanes
    VectorEnv    the lanes as environments of Gymnasium; Env: one lane (extra `gym`)

docs/how_to/step_many_arms.md is an example; robot_dyn/tools/step/README.md lists the files of this folder.
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
