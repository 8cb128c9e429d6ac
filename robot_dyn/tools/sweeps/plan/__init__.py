"""What a sweep is, and the work of a chunk of it.

sweep          `Sweep`: the value that users write
figures        numbers kept of each run; runs: what these are computed from
specification  a sweep as JSON, and the first difference of two
stated         a scene of a folder that its reader has not named
work           runs start, …, stop − 1 as rows
from_scene     the sweep that a scene states, and texts of the command line
"""
