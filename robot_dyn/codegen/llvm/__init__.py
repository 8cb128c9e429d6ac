"""The writer of machine code: programs as LLVM instructions on one number or on vectors, compiled and loaded."""
