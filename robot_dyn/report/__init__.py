"""The base of measured results, their figure, the writer of their files, versions and times.

result            base class of results: a sentence, tables, omitted parts
figure            the layout of their figures
save              saves a result: figure, CSV or JSON by the suffix
environment       versions and processor
timing            times of alternating calls; time_budget: the time that a measurement may take
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
