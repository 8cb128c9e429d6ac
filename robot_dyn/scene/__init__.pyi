# Names that tools and tests import of this folder, and where they live; modules of the core import modules.
from robot_dyn.scene.effects import BY_KIND as BY_KIND
from robot_dyn.scene.explain import of_scene as of_scene
from robot_dyn.scene.scene import parse_scene as parse_scene
from robot_dyn.scene.scene import read_both as read_both
from robot_dyn.scene.schema import Part as Part
from robot_dyn.scene.starters import starter as starter
from robot_dyn.scene.starters import starter_names as starter_names
