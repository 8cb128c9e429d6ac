"""Identification: the parameters of an arm from its motion.

excite               the motion within limits that shows the most about the parameters (Excitation, ExpectedPrecision)
identify             an arm from a log of its motion, or why not (Identification, Parameter, HeldOut, LogError)
                     and the causes of its difference from the file (Verdict, Cause),
                     with the poses or the motion that would tell them apart (Experiment)
payload              the load of an arm from a log with it, and one without it (PayloadEstimate)
static               gravity parameters, offsets and tilt from poses at rest (Poses, StaticEstimate)
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
