# What this folder offers to tools and tests, and where it lives; modules of the core import each other instead.
from robot_dyn.codegen.store.keys import processor_of_code as processor_of_code
from robot_dyn.codegen.store.keys import version_of as version_of
from robot_dyn.codegen.threads import thread_count as thread_count
