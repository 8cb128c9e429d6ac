"""Samples as a motion: read from files, data frames and arrays, joined by a spline, with findings about doubtful ones.

measured                            from_samples: the whole way
spline                              the spline through samples
sources, csv_table, joint_states    columns by heading: of CSV files, data frames, dicts, arrays and logs
columns, headings                   which column is the time and which a joint, in which unit
turns                               whole turns of continuous joints
findings                            doubtful samples
"""
