"""URDF → frozen `Chain`: joints, placements, limits, inertials, gravity, lumped fixed bodies.

`document` parses the XML, `normalise` locks, cuts and snaps it, and `model` reads the result with
pinocchio. CasADi and equations of motion are left to `symgen.mechanics`.
"""

from symgen.chain.model import Chain, Joint, LumpedBody, Tip, read_chain
from symgen.chain.normalise import ChainOptions

__all__ = ["Chain", "ChainOptions", "Joint", "LumpedBody", "Tip", "read_chain"]
