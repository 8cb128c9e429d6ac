"""The error of a run: companion runs, verdicts, requested accuracies."""
