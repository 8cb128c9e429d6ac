"""What every implementation answers: the Dynamics protocol, its quantities, units and batches."""
