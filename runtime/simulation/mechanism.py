"""Parts of a robot that a simulation of independent joints without springs lacks."""

from runtime.errors import SimulationError
from runtime.library import Library


def has_mechanism(lib: Library) -> bool:
    """Whether joints follow others, or springs and curves of known stiffness act on them."""
    manifest = lib.manifest
    return (
        manifest.coupling is not None or bool(manifest.loops) or "known_torque" in manifest.kernels
    )


def require_no_springs(lib: Library) -> None:
    """Raise SimulationError where springs or torque curves act, which compiled simulations lack."""
    if "known_torque" in lib.manifest.kernels:
        raise SimulationError(
            f"springs or torque curves act on '{lib.name}', which the compiled simulation "
            "does not contain; use --engine mujoco (record), or --ideal (ideal)"
        )
