"""The same equations as machine code; compilation uses the files in this order.

trace/                run the formulations on symbols; of each quantity, the shortest becomes a program
parameters            values of a plant and its controller that are inputs of the code, not constants
program               the program: a list of typed instructions without branches
llvm/                 write a program as LLVM, for one state, batches or runs in lock step; compile and load it
store/                keys of machine code, their dependencies, and the folder that stores it
kernel, threads       machine code of one function of states, over batches and threads
self_check            compare a new kernel with an independent implementation
engine                kernels by quantity, each on first use; general arguments and doubtful states
dynamics, plant       the user's objects: `compiled` of a robot or a plant; derivatives: an interpreted substitute
loops/                translate plain functions, such as the loops of a run, from their syntax trees
primitives            whole-array functions of loops, built from the instructions of array_operations
waiting               a message during a long compilation, and delayed Ctrl-C
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
