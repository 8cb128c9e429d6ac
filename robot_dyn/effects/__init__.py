"""What acts on the joints besides actuation: one effect a file, each a torque or a bound, summed by a `Plant`.

The public names are those of `__init__.pyi`, imported when first used.

    effect               base classes: `Conservative`, `Dissipative`, `Active`, `Bound`, `Stateful`, `Drive`
    set_valued, settling base class of effects that hold joints at rest, and the problem that decides which ones
    plant                `Plant`: a robot and its effects; its queries check their arguments
    equation_of_motion   M a + C v + N = Υ with effects, of arguments that are not checked
    hold                 how firmly a joint at rest is held
    geared_motor         what joints driven by motors behind gears share

Every other file is one effect, or a pair of them.
"""

from robot_dyn.public import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
