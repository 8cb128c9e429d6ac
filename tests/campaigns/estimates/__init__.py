"""Random scenes with an independent truth, on which error estimates are judged."""
