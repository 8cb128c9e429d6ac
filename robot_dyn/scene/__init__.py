"""Scenes: a TOML file becomes a validated Setup. Only the effects in the file act; even gravity must be listed.

scene.py         the file: its keys, tables of tools, `read_scene`, and the Setup it describes
effects.py, control.py, references.py    the tables [[effect]], [control] and [reference]
declared.py      tables whose keys are the coefficients of classes, or the arguments of user-defined functions
schema.py        rules for every table: types of values, units, no unknown key
messages.py      line numbers of keys and tables; errors of pydantic as messages: line, key, value
explain.py       the equations of a scene, term by term
starters/        scenes to start from
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
