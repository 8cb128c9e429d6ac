"""The cross-check: one robot by Pinocchio and by the library's own Lagrangian, and its file by a second reader.

compare: `compare` at random states · agreement: the largest difference on its scale · second_reading: by yourdfpy
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
