"""The benchmarks by subject; `scripts/benchmark.py` runs them."""
