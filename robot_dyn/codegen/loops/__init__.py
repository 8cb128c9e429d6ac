"""Plain functions of numbers and arrays as machine code: their syntax trees, translated to LLVM."""
