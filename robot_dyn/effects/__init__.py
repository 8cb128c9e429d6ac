"""What acts on the joints besides actuation: each effect a torque, summed by the plant."""
