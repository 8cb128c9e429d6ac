"""Samples as a motion: read from files, data frames and arrays, joined by a spline, with findings about doubtful ones.

measured                            from_samples: from a source to a motion
spline                              the spline through samples
sources, joint_states               tables of CSV files, data frames, dicts, arrays and logs
other_files                         files of other kinds, refused
table                               columns by heading, and units of headings
recorded                            samples in SI units, after a search for the columns of times and joints
publishers                          two publishers in one log, refused
turns                               whole turns of continuous joints
findings                            doubtful samples
"""
