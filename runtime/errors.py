"""The errors of the run-time tool: each message says what was expected, what came, what to do."""

from runtime.common.errors import CompilerError, LibraryError, RuntimeFault

__all__ = [
    "CompilerError",
    "ExportError",
    "IdentificationError",
    "LibraryError",
    "NeedsError",
    "NotRealisableError",
    "PostureError",
    "RecordingError",
    "RuntimeFault",
    "ShapeError",
    "SimulationError",
]


class ShapeError(RuntimeFault):
    """An array does not have the shape or type that the robot requires."""


class PostureError(RuntimeFault):
    """Positions at which a closed loop cannot close or is singular."""


class NotRealisableError(RuntimeFault):
    """Inertial parameters that are not physically consistent."""


class RecordingError(RuntimeFault):
    """A log file cannot be read, or its content is not a recording of this robot."""


class IdentificationError(RuntimeFault):
    """The data or the options do not define an identification problem that can be solved."""


class NeedsError(IdentificationError):
    """A method lacks an input: the closed-loop description, an unfiltered log, friction columns."""


class SimulationError(IdentificationError):
    """The simulation failed: the mass matrix is not positive definite, or the motion diverged."""


class ExportError(RuntimeFault):
    """The identified model could not be written, or does not reload."""
