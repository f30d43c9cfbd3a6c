"""manifest + shared library → `Library`, one typed NumPy method per kernel, batched.

The only package that uses ctypes. Arrays are sample-major: (N, n), or (n,) for one sample; an
argument without N, such as π, is used for all samples.
"""

from runtime.library.arrays import Array, Indices, Integers, Mask
from runtime.library.free_base import BaseMotion
from runtime.library.library import Library, load, require_library
from runtime.library.manifest import ProxyFacts
from runtime.library.parameters import to_pinocchio_order

__all__ = [
    "Array",
    "BaseMotion",
    "Indices",
    "Integers",
    "Library",
    "Mask",
    "ProxyFacts",
    "load",
    "require_library",
    "to_pinocchio_order",
]
