"""The doctor of URDF files: what is wrong or doubtful in one, and what can be repaired.

check                             the whole check
document, finding                 the file; findings and changes
spelling, literals, limits, names findings in the text
masses, shapes, estimate          findings in the numbers, alone and against the shapes of links
"""
