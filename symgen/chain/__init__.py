"""URDF → frozen `Chain`: joints, placements, limits, inertials, gravity, lumped fixed bodies."""

from symgen.chain.model import Chain, Joint
from symgen.chain.normalise import ChainOptions, moving_joints
from symgen.chain.reading import read_chain

__all__ = ["Chain", "ChainOptions", "Joint", "moving_joints", "read_chain"]
