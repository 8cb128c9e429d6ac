"""What a sweep is, and the work of a chunk of it.

sweep          `Sweep`: the value that users write
figures        numbers kept of each run; runs: what these are computed from
samples        which samples of runs are kept
specification  a sweep as JSON, and the first difference of two
pilot          the size of chunks
work           runs start, …, stop − 1 as rows
"""
