# Names that tools and tests import of this folder, and where they live; modules of the core import modules.
from robot_dyn.shapes import surface as surface
from robot_dyn.shapes.estimate import Estimate as Estimate
from robot_dyn.shapes.estimate import estimates as estimates
from robot_dyn.shapes.estimate import shapes_of_incomplete_links as shapes_of_incomplete_links
from robot_dyn.shapes.masses import Masses as Masses
from robot_dyn.shapes.mesh_files import MeshError as MeshError
from robot_dyn.shapes.triangles import Mesh as Mesh
