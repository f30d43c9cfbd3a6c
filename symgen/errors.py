"""Exceptions of the build tool. A message says what was expected, what came, and what to do."""

from runtime.common.errors import CompilerError, RuntimeFault

__all__ = [
    "BuildError",
    "CollisionError",
    "CompilerError",
    "InertiaError",
    "RankError",
    "SymgenError",
    "UrdfError",
]


class SymgenError(RuntimeFault):
    """Base of the errors of the build tool."""


class UrdfError(SymgenError):
    """The URDF cannot be turned into a kinematic chain."""


class InertiaError(SymgenError):
    """Inertial parameters that are not physically consistent."""


class RankError(SymgenError):
    """The singular values of the sampled regressor decrease without a clear gap."""


class BuildError(SymgenError):
    """The generated folder cannot be written, or does not match its inputs."""


class CollisionError(SymgenError):
    """Collision proxies that do not fit the robot, or geometry that no proxy can be fitted to."""
