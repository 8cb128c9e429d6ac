"""Motions from samples in files, data frames and arrays: a spline through them, and findings about doubtful samples.

measured                            from_samples: from a source to a motion
spline                              the spline through samples
sources, joint_states               tables of CSV files, data frames, dicts, arrays and logs
other_files                         files of other kinds, refused
table                               columns by heading, and units of headings
recorded                            samples in SI units, after a search for the columns of times and joints
publishers                          two publishers in one log, refused
turns                               angles of continuous joints, unwrapped across whole turns
findings                            doubtful samples
"""
