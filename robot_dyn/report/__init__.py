"""The base of measured results: their files, figures, versions and times.

result            base class of results: a sentence, tables, omitted parts; saved as figure, CSV or JSON
figure            the layout of their figures
environment       versions and processor
timing            times of alternating calls; time_budget: the time that a measurement may take
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
