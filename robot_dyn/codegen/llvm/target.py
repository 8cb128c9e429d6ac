"""Targets of machine code: this processor, or another one.

Vectors have eight float64 for every target; LLVM splits them into the registers that there are. Two targets agree to
rounding, because sums may be reordered and products contracted. Portable code has neither: its bits are equal for every
target, except where a program calls the C library (`Kernel.any_angle`, exp, pow, …), and it is slower.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

from robot_dyn.foundations.portable_bits import has_portable_bits

if TYPE_CHECKING:
    import llvmlite.binding as binding

_FLAGS = re.compile(r"(= (?:fadd|fsub|fmul|fdiv|fneg|call))(?: (?:afn|arcp|contract|nsz|reassoc))+ ")


@final
@dataclass(frozen=True)
class Target:
    """A processor that machine code is compiled for.

    Attributes:
        cpu: LLVM's name, such as "x86-64" (SSE2), "x86-64-v3" (AVX2), "x86-64-v4" (AVX-512), "cortex-a72".
        features: LLVM's features, such as "+avx2,-avx512f".
        triple: LLVM's triple, such as "aarch64-linux-gnu"; empty for that of this process.
        portable: True for code without fast-math flags, whose bits are equal for every target.
    """

    cpu: str
    features: str = ""
    triple: str = ""
    portable: bool = False

    def machine(self, effort: int = 3) -> binding.TargetMachine:
        """Return LLVM's target machine; its code is loaded into this process, or linked if it has a triple."""
        import llvmlite.binding as binding

        if self.triple:
            binding.initialize_all_targets()
            binding.initialize_all_asmprinters()
            target = binding.Target.from_triple(self.triple)
            return target.create_target_machine(cpu=self.cpu, features=self.features, opt=effort, reloc="pic")
        binding.initialize_native_target()
        binding.initialize_native_asmprinter()
        target = binding.Target.from_triple(binding.get_process_triple())
        reloc = "static" if target.name.startswith("x86") else "default"
        return target.create_target_machine(
            cpu=self.cpu, features=self.features, opt=effort, reloc=reloc, codemodel="jitdefault", jit=True
        )

    def written(self, text: str) -> str:
        """Return the text of a module for this target: without fast-math flags if it is portable."""
        return _FLAGS.sub(r"\1 ", text) if self.portable else text

    @property
    def key(self) -> tuple[str, ...]:
        """Texts that machine code for this process depends on."""
        return (self.cpu, self.features, *(("portable",) if self.portable else ()))


def this_target() -> Target:
    """Return the target of this process: its processor, and portable code if ROBOT_DYN_PORTABLE is 1."""
    import llvmlite.binding as binding

    features = binding.get_host_cpu_features().flatten()
    return Target(binding.get_host_cpu_name(), features, portable=has_portable_bits())
