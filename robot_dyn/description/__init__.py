"""From a file to checked numbers.

catalog, packages: which file a name means · sources: of other packages · markup, description: a text read safely
urdf, connections: elements checked, links and joints one tree · structure: which links move together
edits: gravity, locks, payloads, armature · couplings: mimic joints, q_full = S q + s₀
inertia, solids, inertial_parameters: mass properties of bodies
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
