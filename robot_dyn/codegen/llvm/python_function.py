"""Machine code as a Python function of the form METH_FASTCALL, and Python's stable C API in machine code."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache

import numpy as np
from llvmlite import ir

from robot_dyn.codegen.llvm.vectors import F64, I32, I64

_FASTCALL = 0x80  # (self, pointer to the arguments, their number)
OBJECT = ir.IntType(8).as_pointer()
# A Py_buffer: data, owner, size, itemsize, readonly, axes, format, lengths, strides, suboffsets, internal
VIEW = ir.LiteralStructType(
    [OBJECT, OBJECT, I64, I64, I32, I32, OBJECT, I64.as_pointer(), I64.as_pointer(), I64.as_pointer(), OBJECT]
)
NDARRAY = "numpy.ndarray"  # symbol of the class
# Functions of Python's C API that the code calls: result and arguments
_API: dict[str, tuple[ir.Type, ...]] = {
    "PyBuffer_IsContiguous": (I32, VIEW.as_pointer(), ir.IntType(8)),
    "PyBuffer_Release": (ir.VoidType(), VIEW.as_pointer()),
    "PyBytes_AsString": (OBJECT, OBJECT),
    "PyErr_Clear": (ir.VoidType(),),
    "PyErr_Occurred": (OBJECT,),
    "PyEval_RestoreThread": (ir.VoidType(), OBJECT),
    "PyEval_SaveThread": (OBJECT,),
    "PyFloat_AsDouble": (F64, OBJECT),
    "PyLong_AsLongLong": (I64, OBJECT),
    "PyLong_FromLongLong": (OBJECT, I64),
    "PyObject_GetBuffer": (I32, OBJECT, VIEW.as_pointer(), I32),
    "PyObject_Type": (OBJECT, OBJECT),
    "Py_DecRef": (ir.VoidType(), OBJECT),
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
    """Return the addresses of the functions of Python's C API, and of the class of arrays, by symbol."""
    functions = {name: ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value or 0 for name in _API}
    return functions | {NDARRAY: id(np.ndarray)}


def python_function(address: int, own: bytes = b"") -> Callable[..., int]:
    """Return the Python function of machine code, whose `self` is `own`."""
    wrap = ctypes.pythonapi.PyCFunction_NewEx
    wrap.restype, wrap.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.py_object, ctypes.py_object]
    return wrap(ctypes.addressof(_method(address)), own, None)


@cache  # the function holds no reference to it
def _method(address: int) -> _Method:
    return _Method(b"kernel", address, _FASTCALL, None)


def function_of(module: ir.Module, name: str) -> ir.Function:
    """Declare a function of this form in a module: arguments (self, pointer to the arguments, their number)."""
    return ir.Function(module, ir.FunctionType(OBJECT, [OBJECT, OBJECT.as_pointer(), I64]), name)


def api(builder: ir.IRBuilder, name: str, *arguments: ir.Value) -> ir.Value:
    """Call a function of Python's C API."""
    function = builder.module.globals.get(name)
    if function is None:
        result, *kinds = _API[name]
        function = ir.Function(builder.module, ir.FunctionType(result, kinds), name)
    return builder.call(function, arguments)
