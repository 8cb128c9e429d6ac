"""Samples as a motion: read from files, data frames and arrays, joined by a spline, with findings about doubtful ones.

measured                            from_samples: the whole way
spline                              the spline through samples
sources, joint_states               tables of CSV files, data frames, dicts, arrays and logs
table                               columns by heading, and units of headings
recorded                            samples in SI units: which column is the time and which a joint
turns                               whole turns of continuous joints
findings                            doubtful samples
"""
