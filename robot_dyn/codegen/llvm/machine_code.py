"""Machine code that survives its process: a module of LLVM compiled to an object file, kept in a store, and loaded.

Machine code is not freed, so a process loads each key once and keeps it: to load it again would lose memory.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from typing import Any, final

import llvmlite.binding as binding
from llvmlite import ir

from robot_dyn.codegen.llvm import python_function
from robot_dyn.codegen.store.store import Store

_LONG = 10_000  # lines: with 15 000, 0.4 s in place of 0.8, at 2 % of the speed; with 31 000, 4 s in place of 12
_lock = threading.RLock()
_loaded: dict[str, bytes] = {}  # object files by key


@final
@dataclass(frozen=True)
class Passes:
    """How hard LLVM works on a module.

    Attributes:
        level: Of its passes over instructions, 0 to 3.
        effort: On registers, 0 to 3; None for as hard as its length allows.
    """

    level: int = 3
    effort: int | None = None


_ALL = Passes()


def address(
    function: str, key: str, write: Callable[[Any, str], None], store: Store | None, about: str = "",
    passes: Passes = _ALL,
) -> int:  # fmt: skip
    """The address of a function of a module; arguments as of `addresses`."""
    return addresses((function,), key, write, store, about, passes)[0]


def addresses(
    functions: Sequence[str], key: str, write: Callable[[Any, str], None], store: Store | None, about: str = "",
    passes: Passes = _ALL,
) -> tuple[int, ...]:  # fmt: skip
    """The addresses of functions of a module, which is restored from the store if it is there.

    Args:
        functions: Their names, without the module's.
        key: What `identity.digest` gives of all that determines the module.
        write: Writes the functions into a module, each by its name after the module's.
        store: Where to look and keep; None for nowhere.
        about: What it is of, for a reader of the store.
        passes: How hard LLVM works.
    """
    name = f"robot_dyn_{key}_"
    with _lock:
        kept = _opened(store.load(key)) if store is not None else None
        if key not in _loaded:
            made = object_file(write, name, passes) if kept is None else kept
            _engine().add_object_file(binding.ObjectFileRef.from_data(made))
            _engine().finalize_object()
            _loaded[key] = made
        if store is not None and kept is None:
            store.save(key, _sealed(_loaded[key]), about)
        return tuple(_engine().get_function_address(name + each) for each in functions)


def object_file(write: Callable[[Any, str], None], name: str, passes: Passes = _ALL) -> bytes:
    """The object file of a module."""
    module = _optimised(write, name, passes.level)
    return _machine(_effort(module) if passes.effort is None else passes.effort).emit_object(module)


def assembly(write: Callable[[Any, str], None], name: str) -> str:
    """The instructions of a module's machine code, as text."""
    return _machine().emit_assembly(_optimised(write, name))


def _optimised(write: Callable[[Any, str], None], name: str, level: int = 3) -> Any:
    module, machine = ir.Module(name), _machine()
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    write(module, name)
    parsed = binding.parse_assembly(str(module))
    options = binding.create_pipeline_tuning_options(speed_level=level)
    options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = False  # it is in vectors
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(parsed, builder)
    return parsed


def _sealed(made: bytes) -> bytes:
    """An object file after its SHA-256: LLVM does not survive a damaged one."""
    return sha256(made).digest() + made


def _opened(payload: bytes | None) -> bytes | None:
    """The object file of a payload; None if it is damaged or there is none."""
    made = (payload or b"")[len(_sealed(b"")) :]
    return made if payload == _sealed(made) else None


def _effort(module: Any) -> int:
    """How hard LLVM works on registers: in one long block its time grows faster than the block."""
    return 1 if str(module).count("\n") > _LONG else 3


def _machine(effort: int = 3) -> Any:
    """LLVM's view of this processor."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    target = binding.Target.from_triple(binding.get_process_triple())
    reloc = "static" if target.name.startswith("x86") else "default"
    features = binding.get_host_cpu_features().flatten()
    return target.create_target_machine(
        cpu=binding.get_host_cpu_name(), features=features, opt=effort, reloc=reloc, codemodel="jitdefault", jit=True
    )


@cache
def _engine() -> Any:
    """What holds the machine code of this process."""
    for name, place in python_function.addresses().items():
        binding.add_symbol(name, place)
    return binding.create_mcjit_compiler(binding.parse_assembly(""), _machine())
