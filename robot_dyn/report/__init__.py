"""The base of measured results, their figure, the writer of their files, versions and times.

result            the base of results: a sentence, tables, what was left out
figure            the sheet of their figures
save              save_result: figure, CSV or JSON by the suffix
environment       versions and processor
timing            times of calls that take turns; time_budget: how long a measurement may take
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
