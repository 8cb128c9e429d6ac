"""The thin layer over Pinocchio: `Robot` computes M, C, N, inverse and forward dynamics by CRBA, RNEA and ABA.

robot: the class · calls: Pinocchio's function for each query
loading: `load` · reading: files · from_pinocchio: robots from a `pinocchio.Model`
pinocchio_model: builds the model
newton_euler: wrenches through moving and fixed joints
evaluation: checks, batches and mimic joints around a call
coriolis, regrouped: C without loss of digits · conditioning: singular or nearly singular M
findings: doubtful values in a valid description · right_angles: right angles with all digits
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
