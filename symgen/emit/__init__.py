"""Kernels → the text of a generated folder, independent of robots and compilers."""

from symgen.emit.files import Early, EmittedRobot, emit, ignored
from symgen.emit.forms import Forms, forms_of
from symgen.emit.sample import c_body
from symgen.emit.ssa import TileProgram, c_constant, tile_program

__all__ = [
    "Early",
    "EmittedRobot",
    "Forms",
    "TileProgram",
    "c_body",
    "c_constant",
    "emit",
    "forms_of",
    "ignored",
    "tile_program",
]
