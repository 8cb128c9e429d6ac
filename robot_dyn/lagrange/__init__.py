"""The library's own implementation: M(q) a + C(q, v) v + N = τ out of K − V, in any arithmetic.

tree, linkage: joints and links in literals, then in numbers · lagrangian: `Lagrangian`
formulas: the closed form, by the names of the queries
summand, christoffel, breakdown: what one body or link adds · recursions: the O(n) algorithms
euler_lagrange, generalized_force, rigid_body: any energies, particles, one body
magnitude, scale: sizes of terms, scales of comparison · exact: true values in balls
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
