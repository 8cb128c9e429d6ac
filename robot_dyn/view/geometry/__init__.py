"""The geometry of a robot: meshes from files and shapes from numbers, as triangles fastened to links.

visuals.py       the pieces of each <visual>, and what replaces one that cannot be read
addresses.py     from the address in a URDF to a file; mesh_files.py: bounded reading and checks
meshes.py        STL, Collada, glTF, OBJ and PLY to triangles; triangles.py: merged corners and normals
shapes.py, inertia_boxes.py    boxes, cylinders, ellipsoids, arrows; the box of an inertia
"""
