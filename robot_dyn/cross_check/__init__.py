"""The cross-check: a robot computed by Pinocchio and by the library's Lagrangian, and its file read by a second reader.

compare: `compare` at random states · agreement: the largest differences on their scales
second_reading: by yourdfpy
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
