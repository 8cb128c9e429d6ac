"""What a digit of M, C, N, inverse and forward dynamics costs."""
