"""Foundations: arithmetic, spatial algebra, checks of arguments, errors, values, files and the display of results.

arithmetic, linear_algebra, spatial   numbers of any arithmetic; small dense systems; rigid-body transforms
convex, saturation, threshold         the convex problem of dry friction and stops; limits; levels at which laws switch
coefficients, validate, signatures    declared coefficients; checks of arguments; signatures of options
values, result, answer, display       value objects; results as data, as lines and tables, as HTML
errors, files, store, extras, public  errors; safe reading and writing; files of values; packages; public names
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
