"""Results and timings of a tree, stored and compared with those of another one; see scripts/before.py.

library    the library's names that the referee uses, each once: after a rename, a line there changes
runs       87 runs
sweeps     30 sweeps on given design tables
timings    55 named timings
results    how results are stored as arrays and texts, and compared
"""
