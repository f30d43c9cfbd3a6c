"""manifest + shared library → `Library`, one typed NumPy method per kernel, batched.

The only package that uses ctypes. Arrays are sample-major: (N, n), or (n,) for one sample; an
argument without N, such as π, is used for all samples.
"""

from typing import TYPE_CHECKING

from runtime.library.binding import Array
from runtime.library.free_base import BaseMotion
from runtime.library.library import Library
from runtime.library.load import load
from runtime.library.manifest import (
    BrakingFacts,
    JointFacts,
    Manifest,
    PairFacts,
    ProxyFacts,
)
from runtime.library.parameters import to_pinocchio_order
from runtime.startup.lazy_names import lazy_names

if TYPE_CHECKING:
    from runtime.library.compiled_closed_loop import (
        NOT_POSITIVE,
        ClosedLoopController,
        ClosedLoopPlant,
        CompiledClosedLoop,
    )
    from runtime.library.compiled_convex import CompiledConvex, ConvexAnswer, ConvexTask
    from runtime.library.compiled_descent import (
        AdamProblem,
        CompiledAdam,
        CompiledLevenberg,
        LeastSquares,
    )

__getattr__ = lazy_names(
    __name__,
    {
        "AdamProblem": "runtime.library.compiled_descent",
        "ClosedLoopController": "runtime.library.compiled_closed_loop",
        "ClosedLoopPlant": "runtime.library.compiled_closed_loop",
        "CompiledAdam": "runtime.library.compiled_descent",
        "CompiledClosedLoop": "runtime.library.compiled_closed_loop",
        "CompiledConvex": "runtime.library.compiled_convex",
        "CompiledLevenberg": "runtime.library.compiled_descent",
        "ConvexAnswer": "runtime.library.compiled_convex",
        "ConvexTask": "runtime.library.compiled_convex",
        "LeastSquares": "runtime.library.compiled_descent",
        "NOT_POSITIVE": "runtime.library.compiled_closed_loop",
    },
)

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
    "to_pinocchio_order",
]
