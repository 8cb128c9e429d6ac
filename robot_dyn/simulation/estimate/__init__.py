"""The error of a run.

- estimate: choice of the companion runs; verdicts: the error from their differences, and its basis.
- requested_accuracy: trial runs until the estimated error is at most the requested one.
"""
