"""What the summary of a run remarks."""
