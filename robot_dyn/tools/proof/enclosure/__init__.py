"""One proven step, in balls.

step        the step, shortened until all bounds hold
polynomial  the Taylor polynomial and its defect
tube        a set that the motion cannot leave
linearised  the Jacobian on sets
lohner      the error set from step to step
balls       bounds of balls, of matrices, and of solutions of M x = r
"""
