"""Machine code as a function of Python, of the form METH_FASTCALL, and Python's C API in machine code."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir

from robot_dyn.codegen.llvm.numpy_array import check_structure
from robot_dyn.codegen.llvm.vectors import F64, I64

_FASTCALL = 0x80  # (self, pointer to the arguments, their number)
OBJECT = ir.IntType(8).as_pointer()
# Functions of Python's C API that the code calls: result and arguments
_API: dict[str, tuple[Any, ...]] = {
    "PyFloat_AsDouble": (F64, OBJECT),
    "PyErr_Occurred": (OBJECT,),
    "PyErr_Clear": (ir.VoidType(),),
    "PyLong_AsLongLong": (I64, OBJECT),
    "PyLong_FromLongLong": (OBJECT, I64),
    "PyEval_SaveThread": (OBJECT,),
    "PyEval_RestoreThread": (ir.VoidType(), OBJECT),
}


class _Method(ctypes.Structure):
    """PyMethodDef."""

    _fields_ = [
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    ]


def addresses() -> dict[str, int]:
    """Addresses of the functions of Python's C API by name."""
    return {name: ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value or 0 for name in _API}


def python_function(address: int, like: np.ndarray) -> Callable[..., int]:
    """The Python function of machine code that reads arrays, whose `self` is this array.

    Raises:
        ArrayStructureError: If this NumPy has the fields of arrays at other offsets.
    """
    check_structure()
    wrap = ctypes.pythonapi.PyCFunction_NewEx
    wrap.restype, wrap.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.py_object, ctypes.py_object]
    return wrap(ctypes.addressof(_method(address)), like, None)


@cache  # the function holds no reference to it
def _method(address: int) -> _Method:
    return _Method(b"kernel", address, _FASTCALL, None)


def function_of(module: Any, name: str) -> Any:
    """A function of this form in a module: arguments (self, pointer to the arguments, their number)."""
    return ir.Function(module, ir.FunctionType(OBJECT, [OBJECT, OBJECT.as_pointer(), I64]), name)


def api(builder: Any, name: str, *arguments: Any) -> Any:
    """Call a function of Python's C API."""
    function = builder.module.globals.get(name)
    if function is None:
        result, *kinds = _API[name]
        function = ir.Function(builder.module, ir.FunctionType(result, kinds), name)
    return builder.call(function, arguments)
