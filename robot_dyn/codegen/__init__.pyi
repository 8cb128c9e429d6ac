# Names that tools and tests import of this folder, and where they live; modules of the core import modules.
from robot_dyn.codegen.dynamics import CompiledDynamics as CompiledDynamics
from robot_dyn.codegen.engine import SizeWarning as SizeWarning
from robot_dyn.codegen.kernel import Kernel as Kernel
from robot_dyn.codegen.loops.call import MachineFunction as MachineFunction
from robot_dyn.codegen.plant import CompiledPlant as CompiledPlant
from robot_dyn.codegen.primitives import INSTEAD as INSTEAD
from robot_dyn.codegen.self_check import SelfCheckError as SelfCheckError
from robot_dyn.codegen.store.cache import CacheWarning as CacheWarning
from robot_dyn.codegen.store.cache import Store as Store
from robot_dyn.codegen.store.cache import default_store as default_store
from robot_dyn.codegen.store.keys import digest_of_texts as digest_of_texts
from robot_dyn.codegen.store.keys import processor_of_code as processor_of_code
from robot_dyn.codegen.threads import thread_count as thread_count
from robot_dyn.codegen.trace.from_casadi import program_of as program_of
from robot_dyn.codegen.trace.trace import Trace as Trace
