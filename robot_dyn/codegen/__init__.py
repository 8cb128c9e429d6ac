"""The same equations as machine code; a compile runs through the files in this order.

trace/                run the formulations on symbols; of each quantity, the shortest becomes a program
parameters            numbers of a plant and its controller that are inputs of the code, not constants
program               the program: a list of typed instructions without branches
llvm/                 write a program as LLVM, for one state, batches or runs in lock step; compile and load it
store/                keys of machine code, what they depend on, and the folder that stores it
kernel, threads       machine code of one function of states, over batches and threads
self_check            compare a new kernel with an independent implementation
engine                kernels by quantity, each on first use; general arguments and states in doubt
dynamics, plant       what users hold: `Compiled` of a robot or a plant; derivatives: their interpreted substitute
loops/                translate plain functions, such as the loops of a run, from their syntax trees
primitives            what loops do with whole arrays, by the instructions of array_operations
waiting               what a user notices of a compile: a message, and Ctrl-C delayed
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
