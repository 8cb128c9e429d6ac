"""What accuracy costs, and how far the numbers can be believed."""
