"""The shapes of links, and the inertias that they would have.

estimate, masses                  inertials that a file does not state, and the masses for them
link_shapes                       the shape of a link as bodies of density 1
surface, primitives               solid, hull and shell of triangles; of a box, cylinder or sphere
closed_parts, winding             parts of a mesh: inside out, cavities, overlaps; by winding numbers
elements, addresses               numbers of <visual> and <collision>; from an address to a file
mesh_files, meshes, triangles     bounded reading of mesh files, and their triangles, which the viewer draws too
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
