"""Plain functions of numbers and arrays as machine code: their syntax trees, translated to LLVM.

call              a function that is translated for the types of its arguments on the first call; packing: arguments
source            the syntax tree of a function; dependencies: what its machine code depends on
program, function one module of functions; one function, whose types settle before it is written
statements, expressions, calls    the subset, construct by construct
numbers, arrays, vectors          arithmetic, entries and views, operations on whole arrays
kinds, values     types and values of the subset
"""
