"""The errors of the run-time tool: each message says what was expected, what came, what to do."""


class RuntimeFault(Exception):
    """Base of every error that a user of runtime can cause; the CLI prints it as one sentence."""


class LibraryError(RuntimeFault):
    """The generated library is missing, stale, foreign or damaged."""


class ShapeError(RuntimeFault):
    """An array does not have the shape or type that the robot asks for."""


class NotRealisableError(RuntimeFault):
    """Inertial parameters that no body of positive density can have."""


class RecordingError(RuntimeFault):
    """A log file cannot be read, or what it holds cannot be a recording of this robot."""


class IdentificationError(RuntimeFault):
    """The data or the options do not determine an identification problem that can be solved."""


class NeedsError(IdentificationError):
    """A method was not given what it works on: the loop, a raw log, friction columns."""


class SimulationError(IdentificationError):
    """The simulated robot cannot move like that: its mass matrix is none, or it ran away."""


class ExportError(RuntimeFault):
    """The identified model could not be written, or does not reload."""
