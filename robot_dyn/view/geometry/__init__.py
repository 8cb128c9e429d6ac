"""The geometry of a robot: meshes read from files, shapes made of numbers, all as triangles fastened to links."""
