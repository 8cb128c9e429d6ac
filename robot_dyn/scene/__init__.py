"""Scenes: a TOML file becomes a validated Setup. What a scene does not name does not act, gravity included.

scene.py         the file: its keys, tables of tools, `read_scene`, and the Setup it describes
effects.py, control.py, references.py    the tables [[effect]], [control] and [reference]
declared.py      tables whose keys are the coefficients that classes declare, and those of callables of the caller
schema.py        rules for every table: types of values, units, no unknown key
messages.py      the lines of keys and tables at the top; errors of pydantic as messages: line, key, value
explain.py       what a scene integrates, term by term; manual.py writes docs/reference/scenes.md
starters/        scenes to start from
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
