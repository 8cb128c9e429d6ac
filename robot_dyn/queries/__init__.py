"""What every implementation answers.

dynamics: the `Dynamics` protocol and `Axes` · quantity: its quantities as values · batch: states without an answer
units: SI units of joints, and numbers with their units as texts
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
