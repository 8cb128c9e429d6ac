"""What the robot is: a checked description, and the dynamics that follow from it."""
