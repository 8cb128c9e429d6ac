"""Machine code that persists between processes: an LLVM module is compiled to an object file, stored and loaded.

Machine code is never freed, so a process loads each key only once.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from typing import TYPE_CHECKING, final

import llvmlite.binding as binding
from llvmlite import ir

from robot_dyn.codegen.llvm import python_function
from robot_dyn.codegen.llvm.target import Target, this_target

if TYPE_CHECKING:
    from robot_dyn.codegen.store.cache import Store

Write = Callable[[ir.Module, str], None]  # writes functions into a module, with a prefix before each name
_lock = threading.RLock()
_loaded: dict[str, bytes] = {}  # object files by key


@final
@dataclass(frozen=True)
class Passes:
    """Optimisation levels of LLVM for a module.

    Attributes:
        level: Level of the passes over instructions, 0 to 3.
        effort: Level of instruction selection and scheduling, 0 to 3. Above 1, instructions are scheduled a second
            time, after registers are allocated: that doubles the time of a long block without making its code faster.
    """

    level: int = 3
    effort: int = 1


_ALL = Passes()


def addresses(
    functions: Sequence[str], key: str, write: Write, store: Store | None, about: str = "",
    passes: Passes = _ALL,
) -> tuple[int, ...]:  # fmt: skip
    """Return the addresses of functions of a module; it is loaded from the store if it is there, otherwise compiled.

    Args:
        functions: Names of the functions, without the prefix of the module.
        key: The `digest` of everything that determines the module.
        write: Function that writes the functions into a module, with a prefix before each name.
        store: Store of machine code, or None.
        about: Description of what the module computes, saved in the store.
        passes: Optimisation levels.
    """
    name = f"robot_dyn_{key}_"
    with _lock:
        stored = _opened(store.load(key)) if store is not None else None
        if key not in _loaded:
            code = object_file(write, name, passes) if stored is None else stored
            _engine().add_object_file(binding.ObjectFileRef.from_data(code))
            _engine().finalize_object()
            _loaded[key] = code
        if store is not None and stored is None:
            store.save(key, _sealed(_loaded[key]), about)
        return tuple(_engine().get_function_address(name + function) for function in functions)


def object_file(write: Write, name: str, passes: Passes = _ALL, target: Target | None = None) -> bytes:
    """Compile a module to an object file, for this processor or another target."""
    target = target or this_target()
    return target.machine(passes.effort).emit_object(_optimised(write, name, target, passes.level))


def assembly(write: Write, name: str) -> str:
    """Return the instructions of a module's machine code as text."""
    target = this_target()
    return target.machine(_ALL.effort).emit_assembly(_optimised(write, name, target))


def _optimised(write: Write, name: str, target: Target, level: int = 3) -> binding.ModuleRef:
    module, machine = ir.Module(name), target.machine()
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    write(module, name)
    parsed = binding.parse_assembly(target.written(str(module)))
    options = binding.create_pipeline_tuning_options(speed_level=level)
    options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = (
        False  # the code is vectorised already
    )
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(parsed, builder)
    return parsed


def _sealed(code: bytes) -> bytes:
    """Prefix an object file with its SHA-256, because a corrupt file crashes LLVM."""
    return sha256(code).digest() + code


def _opened(payload: bytes | None) -> bytes | None:
    """Return the object file in a payload; None if the payload is corrupt or missing."""
    code = (payload or b"")[len(_sealed(b"")) :]
    return code if payload == _sealed(code) else None


@cache
def _engine() -> binding.ExecutionEngine:
    """Return the execution engine into which this process loads all machine code."""
    for name, location in python_function.addresses().items():
        binding.add_symbol(name, location)
    return binding.create_mcjit_compiler(binding.parse_assembly(""), this_target().machine())
