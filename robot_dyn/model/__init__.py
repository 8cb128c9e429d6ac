"""The thin layer over Pinocchio: `Robot` gives M, C, N, inverse and forward dynamics by CRBA, RNEA and ABA.

robot: the class · calls: Pinocchio's call for each query · loading: `load` · from_pinocchio: of a `pinocchio.Model`
pinocchio_model: how the model is built
evaluation: checks, batches and mimic joints around a call
coriolis, regrouped: C without loss of digits · conditioning: M singular or nearly so
findings: what is doubtful in a description that loads · right_angles: those of a file written out in full
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
