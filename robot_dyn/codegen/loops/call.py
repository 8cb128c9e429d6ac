"""A plain function as machine code: compiled for the types of its arguments, or restored from a store.

Arguments are passed as words, such as the addresses of arrays; a call packs only arguments that changed.
"""

from __future__ import annotations

import ctypes
import threading
from array import array
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, Any, final

from robot_dyn.codegen.llvm import machine_code
from robot_dyn.codegen.llvm.machine_code import Passes
from robot_dyn.codegen.loops.dependencies import Instead, dependencies
from robot_dyn.codegen.loops.kinds import Kind, Number, Static, TupleKind, Unpacked, unpacked, words
from robot_dyn.codegen.loops.packing import Packed, pack
from robot_dyn.codegen.store.cache import Store
from robot_dyn.codegen.store.keys import digest, sources_of_the_translator
from robot_dyn.codegen.waiting import COMPILING, interrupts_later
from robot_dyn.foundations.errors import MachineCodeError
from robot_dyn.foundations.waiting import log_if_slow

if TYPE_CHECKING:
    from llvmlite import ir

_ENTRY = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_void_p, ctypes.c_void_p)
Entry = Callable[[int, int], bytes | None]  # (addresses of the arguments, address of the result) → a failure
_LETTERS: Mapping[str, str] = {"float": "f", "int": "i", "uint": "u", "bool": "b"}
_NUMBERS = {letter: Number(name) for name, letter in _LETTERS.items()}
QUICK = Passes(level=1, effort=1)  # most work is in called functions


@final
class MachineFunction:
    """A function as machine code for any argument types; `calls` returns a caller.

    Args:
        function: A plain function.
        instead: Substitutes for functions, see `Program`.
        store: Function that returns the store of machine code, or None.
        about: Description for readers of the store.
        passes: Optimisation levels of LLVM.
    """

    def __init__(
        self, function: Callable[..., object], instead: Instead,
        store: Callable[[], Store | None], about: str, passes: Passes = QUICK,
    ) -> None:  # fmt: skip
        self.function, self.about, self._passes = function, about, passes
        self.store, self._instead, self._lock = store, instead, threading.Lock()
        self._entries: dict[Hashable, tuple[Entry, Kind]] = {}

    def calls(self) -> Call:
        """Return a caller, for one thread at a time."""
        return Call(self)

    def check(self, *arguments: object) -> None:
        """Translate the function for such arguments, without compiling it.

        Raises:
            SubsetError: If it is outside the subset.
        """
        from robot_dyn.codegen.loops.program import translated

        translated(self.function, pack(arguments, self.store).kinds, self._instead)

    def key(self, kinds: tuple[Kind, ...]) -> str:
        """Return the key of its machine code in a store."""
        return self._key(kinds, dependencies(self.function, self._instead))

    def _key(self, kinds: tuple[Kind, ...], texts: list[str]) -> str:
        return digest(["loop", str(self._passes), sources_of_the_translator(), *map(repr, kinds), *texts])

    def is_kept(self) -> bool:
        """Return True if its machine code, for some argument types, is in memory or in the store."""
        store = self.store()
        return bool(self._entries) or (store is not None and store.load(self._note) is not None)

    @cached_property
    def _note(self) -> str:
        """Key of the note that the machine code is stored; it depends on the code and values at compile time."""
        return self.key(())

    def entry(self, place: Hashable, kinds: Sequence[Kind]) -> tuple[Entry, Kind]:
        """Return the function that takes words, and the type of its result.

        Args:
            place: A key for the types, or their number.
            kinds: Types of the arguments.

        Raises:
            SubsetError: If it is outside the subset.
        """
        if place in self._entries:
            return self._entries[place]
        began, types = perf_counter(), tuple(kinds)
        with self._lock, interrupts_later():
            if types not in self._entries:
                with log_if_slow(f"compiling {self.about} (cached for this version)"):
                    self._entries[types] = self._compiled(types)
            self._entries[place] = self._entries[types]
        COMPILING.seconds += perf_counter() - began
        return self._entries[place]

    def _compiled(self, kinds: tuple[Kind, ...]) -> tuple[Entry, Kind]:
        def write(module: ir.Module, prefix: str) -> None:
            from llvmlite import ir

            from robot_dyn.codegen.loops.kinds import TEXT
            from robot_dyn.codegen.loops.program import Program

            program = Program(module, prefix, self._instead)
            result = program.entry(self.function, kinds, "call")  # pyright: ignore
            of_result = ir.Function(module, ir.FunctionType(TEXT, []), f"{prefix}result")
            ir.IRBuilder(of_result.append_basic_block()).ret(program.text(_written(result)))

        texts = dependencies(self.function, self._instead)
        key, note, store = self._key(kinds, texts), self._key((), texts), self.store()
        call, result = machine_code.addresses(("call", "result"), key, write, store, self.about, self._passes)
        if store is not None and store.load(note) is None:
            store.save(note, b"", f"{self.about}, marker")
        text = ctypes.CFUNCTYPE(ctypes.c_char_p)(result)().decode()
        return _ENTRY(call), _read(text)


@final
class Call:
    """A caller of machine code whose arguments change little between calls.

    Raises:
        MachineCodeError: If the code fails; the message names the line.
    """

    def __init__(self, function: MachineFunction) -> None:
        self._function = function
        self._given: list[object] = []
        self._kinds: list[Kind] = []
        self._packed: dict[tuple[int, ...], Packed] = {}  # by the indices of their arguments
        self._entry: Entry = _ENTRY()

    def __call__(self, *arguments: object) -> Any:
        """Return the result of the function for these arguments."""
        before = self._given
        if len(before) != len(arguments):
            self._given, self._packed, self._kinds = (
                [None] * len(arguments),
                {},
                [Static.from_value(None)] * len(arguments),
            )
            self._block = array("q", bytes(8 * len(arguments)))
            self._take(tuple(range(len(arguments))), arguments)
        else:
            others = tuple([i for i, argument in enumerate(arguments) if argument is not before[i]])
            if others:
                self._take(others, arguments)
        text = self._entry(self._addresses, self._out_address)
        if text is not None:
            raise MachineCodeError(text.decode())
        return self._result()

    def _take(self, others: tuple[int, ...], arguments: tuple[object, ...]) -> None:
        """Pack the arguments that differ from those of the previous call."""
        packed, same = pack(tuple([arguments[i] for i in others]), self._function.store), True
        self._packed[others] = packed
        for i, start, kind in zip(others, packed.starts, packed.kinds, strict=True):
            same &= self._kinds[i] is kind
            self._given[i], self._block[i], self._kinds[i] = arguments[i], start, kind
        if not same:
            whole = packed.number if len(others) == len(arguments) else tuple(self._kinds)
            self._entry, self._kind = self._function.entry(whole, self._kinds)
            self._out = array("q", bytes(8 * max(1, words(self._kind))))
            self._addresses, self._out_address = self._block.buffer_info()[0], self._out.buffer_info()[0]

    def _result(self) -> Unpacked:
        return unpacked(self._out.tolist(), self._kind)


def _written(kind: Kind) -> str:
    if isinstance(kind, TupleKind):
        return f"({''.join(map(_written, kind.items))})"
    return _LETTERS[kind.name] if isinstance(kind, Number) else "-"


def _read(text: str) -> Kind:
    """Return the type of a text that `_written` returned."""
    stack: list[list[Kind]] = [[]]
    for letter in text:
        if letter == "(":
            stack.append([])
        elif letter == ")":
            items = stack.pop()
            stack[-1].append(TupleKind(tuple(items)))
        else:
            stack[-1].append(_NUMBERS.get(letter, Static.from_value(None)))
    return stack[0][0]
