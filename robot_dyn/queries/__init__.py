"""What every implementation answers.

dynamics: `Dynamics`, the queries and their table · quantity: a row of it · batch: states without an answer
units: SI units of joints, and numbers with their units as texts
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
