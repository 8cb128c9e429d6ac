"""The library's own implementation: M(q) a + C(q, v) v + N(q) = τ from K − V, in any arithmetic.

tree, linkage: joints and links in literals, then in numbers · lagrangian: `Lagrangian`
formulas: closed forms, by the names of the queries
summand, christoffel, breakdown: terms of one body or link · recursions: the O(n) algorithms
euler_lagrange, generalized_force, rigid_body: any energies, particles, one body
magnitude, scale: sizes of terms, scales of comparison · exact: true values in balls
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
