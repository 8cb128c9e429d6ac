"""What is observed at the end of every step, and the remarks that follow."""
