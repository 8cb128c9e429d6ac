"""The geometry of a robot as triangles fastened to links; mesh files are read in the room `shapes`.

visuals.py       the pieces of each <visual>, and replacements for unreadable ones
coarse.py        meshes with fewer triangles
shapes.py, inertia_boxes.py    boxes, cylinders, ellipsoids, arrows; the box of an inertia
"""
