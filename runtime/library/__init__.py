"""manifest + shared library → `Library`, one typed NumPy method per kernel, batched.

The only package that uses ctypes. Arrays are sample-major: (N, n), or (n,) for one sample; an
argument without N, such as π, is used for all samples.
"""

from runtime.library.binding import Array
from runtime.library.compiled_descent import (
    AdamProblem,
    CompiledAdam,
    CompiledConvex,
    CompiledLevenberg,
    ConvexAnswer,
    ConvexTask,
    LeastSquares,
)
from runtime.library.compiled_programs import (
    NOT_POSITIVE,
    ClosedLoopController,
    ClosedLoopPlant,
    CompiledClosedLoop,
)
from runtime.library.free_base import BaseMotion
from runtime.library.library import Library, load, require_library
from runtime.library.manifest import (
    BrakingFacts,
    JointFacts,
    Manifest,
    PairFacts,
    ProxyFacts,
)
from runtime.library.parameters import to_pinocchio_order

__all__ = [
    "NOT_POSITIVE",
    "AdamProblem",
    "Array",
    "BaseMotion",
    "BrakingFacts",
    "ClosedLoopController",
    "ClosedLoopPlant",
    "CompiledAdam",
    "CompiledClosedLoop",
    "CompiledConvex",
    "CompiledLevenberg",
    "ConvexAnswer",
    "ConvexTask",
    "JointFacts",
    "LeastSquares",
    "Library",
    "Manifest",
    "PairFacts",
    "ProxyFacts",
    "load",
    "require_library",
    "to_pinocchio_order",
]
