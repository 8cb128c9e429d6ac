"""The error of a run.

- estimate: which companion runs are needed; verdicts: the error from their differences, and what it rests on.
- requested_accuracy: trial runs until the estimated error is at most the requested one.
"""
