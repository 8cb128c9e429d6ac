"""The queries of every implementation.

dynamics: `Dynamics`, the queries and their table · quantity: a row of the table · batch: states without a result
units: SI units of joints, and numbers with their units as text
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
