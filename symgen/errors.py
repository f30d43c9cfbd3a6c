"""The errors of the build-time tool: each message says what was expected, what came, what to do."""


class SymgenError(Exception):
    """Base of every error that a user of symgen can cause; the CLI prints it as one sentence."""


class UrdfError(SymgenError):
    """The URDF cannot be turned into a kinematic chain."""


class InertiaError(SymgenError):
    """Inertial parameters that no body of positive density can have."""


class RankError(SymgenError):
    """The sampled regressor shows no clear gap between excited and silent directions."""


class CompilerError(SymgenError):
    """No C compiler was found, or it refused the generated code."""


class BuildError(SymgenError):
    """The generated folder could not be written, or does not match its inputs."""


class CollisionError(SymgenError):
    """Proxies that do not fit the robot, or geometry to which none can be fitted."""
