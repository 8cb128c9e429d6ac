# The public names of this tool and where they live: type checkers read this file, and __init__.py does.
from robot_dyn.tools.proof.proven_run import prove as prove
from robot_dyn.tools.proof.theorem import Proof as Proof

__all__: list[str]
