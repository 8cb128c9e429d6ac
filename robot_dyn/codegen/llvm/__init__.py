"""The writer of machine code: programs as LLVM instructions on numbers or vectors, compiled and loaded.

writer            from a program to instructions, by the tables of operations; sine_groups: several sines at once
vectors           vectors of numbers; elementary: their sine, cosine and tanh
one_state, batch, lock_step    functions of one state, of arrays of states, of runs in lock step
rows              rows of arrays to vectors and back
entries           functions that Python calls, by python_function (its C API) and numpy_array (its fields)
machine_code      compile, store and load a module; target: for this processor or another one
"""
