"""Shapes of links, and inertias estimated from them.

estimate, masses                  estimated inertials of links without one, and their masses
link_shapes                       the shape of a link as bodies of density 1
surface, primitives               solid, hull and shell of triangles; of a box, cylinder or sphere
closed_parts, winding             parts of a mesh: inside out, cavities, overlaps; by winding numbers
elements, addresses               numbers of <visual> and <collision>; the file of an address
mesh_files, meshes, triangles     bounded reading of mesh files; the viewer draws the same triangles
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
