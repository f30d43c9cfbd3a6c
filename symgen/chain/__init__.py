"""URDF → frozen `Chain`: joints, placements, limits, inertials, gravity, lumped fixed bodies.

`document` cuts and normalises the XML, pinocchio parses it, `model` reads pinocchio's answer.
Nothing here knows CasADi or an equation of motion.
"""

from symgen.chain.document import ChainOptions
from symgen.chain.model import Chain, Joint, LumpedBody, Tip, read_chain

__all__ = ["Chain", "ChainOptions", "Joint", "LumpedBody", "Tip", "read_chain"]
