"""manifest + shared library → `Library`, one typed NumPy method per kernel, batched.

The only room that knows ctypes. Arrays are sample-major: (N, n), or (n,) for one sample; an
argument given once, such as π, serves all samples.
"""

from runtime.library.binding import Array
from runtime.library.convex import CompiledConvex, ConvexAnswer, ConvexTask
from runtime.library.descent import AdamProblem, CompiledAdam, CompiledLevenberg, LeastSquares
from runtime.library.library import Library
from runtime.library.load import load
from runtime.library.manifest import JointFacts, Manifest, to_pinocchio_order

__all__ = [
    "AdamProblem",
    "Array",
    "CompiledAdam",
    "CompiledConvex",
    "CompiledLevenberg",
    "ConvexAnswer",
    "ConvexTask",
    "JointFacts",
    "LeastSquares",
    "Library",
    "Manifest",
    "load",
    "to_pinocchio_order",
]
