# Names that tools and tests import of this folder, and where they live; modules of the core import modules.
from robot_dyn.cli import arguments as arguments
from robot_dyn.cli import completion as completion
from robot_dyn.cli.application import GROUPS as GROUPS
from robot_dyn.cli.application import bar as bar
from robot_dyn.cli.application import command as command
from robot_dyn.cli.application import program as program
from robot_dyn.cli.application import progress as progress
from robot_dyn.cli.options import AS_STATED as AS_STATED
from robot_dyn.cli.options import FILE_AS_STATED as FILE_AS_STATED
from robot_dyn.cli.options import PRINTED as PRINTED
from robot_dyn.cli.options import Effects as Effects
from robot_dyn.cli.options import FileOptions as FileOptions
from robot_dyn.cli.options import Force as Force
from robot_dyn.cli.options import Json as Json
from robot_dyn.cli.options import Name as Name
from robot_dyn.cli.options import Payloads as Payloads
from robot_dyn.cli.options import Results as Results
from robot_dyn.cli.options import RobotOptions as RobotOptions
from robot_dyn.cli.options import Scene as Scene
from robot_dyn.cli.terminal import say as say
from robot_dyn.cli.terminal import say_json as say_json
from robot_dyn.cli.terminal import show as show
from robot_dyn.cli.terminal import to_stderr as to_stderr

def main() -> None: ...
