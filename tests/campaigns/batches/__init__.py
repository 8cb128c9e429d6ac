"""Random batches, each run of which is compared with the run that `simulate` makes of it."""
