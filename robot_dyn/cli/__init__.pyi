# Names that tools and tests import of this folder, and where they live; modules of the core import modules.
from robot_dyn.cli import arguments as arguments
from robot_dyn.cli import completion as completion
from robot_dyn.cli.application import Csv as Csv
from robot_dyn.cli.application import Dark as Dark
from robot_dyn.cli.application import Force as Force
from robot_dyn.cli.application import Json as Json
from robot_dyn.cli.application import Name as Name
from robot_dyn.cli.application import PackageDir as PackageDir
from robot_dyn.cli.application import Plot as Plot
from robot_dyn.cli.application import Scene as Scene
from robot_dyn.cli.application import Xacro as Xacro
from robot_dyn.cli.application import app as app
from robot_dyn.cli.application import bar as bar
from robot_dyn.cli.application import progress as progress
from robot_dyn.cli.outcome import give as give
from robot_dyn.cli.outcome import outputs as outputs
from robot_dyn.cli.robots import AS_STATED as AS_STATED
from robot_dyn.cli.robots import RobotOptions as RobotOptions
from robot_dyn.cli.robots import takes_robot as takes_robot
from robot_dyn.cli.terminal import say as say
from robot_dyn.cli.terminal import say_json as say_json
from robot_dyn.cli.terminal import to_stderr as to_stderr

def main() -> None: ...
