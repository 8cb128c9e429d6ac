"""A plant, a controller, a method and a duration → a trajectory with an estimate of its error."""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
