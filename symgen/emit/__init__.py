"""Kernels → the text of a generated folder; knows no robots and no compilers."""

from symgen.emit.files import EmittedRobot, emit
from symgen.emit.forms import Forms, forms_of
from symgen.emit.ssa import TileProgram, c_body, c_constant, tile_program

__all__ = [
    "EmittedRobot",
    "Forms",
    "TileProgram",
    "c_body",
    "c_constant",
    "emit",
    "forms_of",
    "tile_program",
]
