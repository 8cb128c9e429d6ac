"""Two runs beside each other: how far they are apart, when they part, and which settings differ."""
