"""What a digit of a motion costs: error against time and evaluations, also of other programs."""
