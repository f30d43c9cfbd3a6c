"""Kernels → the text of a generated folder; knows no robots and no compilers."""

from symgen.emit.files import EmittedRobot, emit
from symgen.emit.ssa import TileProgram, c_body, c_constant, tile_program

__all__ = ["EmittedRobot", "TileProgram", "c_body", "c_constant", "emit", "tile_program"]
