"""The error of a run.

- estimate: which companion runs are needed; companions: the error from their differences, with a verdict.
- requested_accuracy: trial runs until the estimated error is at most the requested one.
"""
