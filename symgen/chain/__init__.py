"""URDF → frozen `Chain`: joints, placements, limits, inertials, gravity, lumped fixed bodies.

`document` parses the XML, `normalise` locks, cuts and snaps it, pinocchio reads the result,
`model` reads pinocchio's answer.
Nothing here knows CasADi or an equation of motion.
"""

from symgen.chain.model import Chain, Joint, LumpedBody, Tip, read_chain
from symgen.chain.normalise import ChainOptions

__all__ = ["Chain", "ChainOptions", "Joint", "LumpedBody", "Tip", "read_chain"]
