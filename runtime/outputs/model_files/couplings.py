"""Joints that follow others by constant factors, from the manifest."""

from runtime.library.manifest import Manifest


def couplings(manifest: Manifest) -> dict[str, tuple[dict[str, float], float]]:
    """Dependent joint → its masters with their factors, and its offset [rad, m]."""
    coupling = manifest.coupling
    if coupling is None:
        return {}
    names = [joint.name for joint in manifest.joints]
    return {
        joint.name: (
            {name: float(f) for name, f in zip(names, factors, strict=True) if f != 0},
            float(offset),
        )
        for joint, factors, offset in zip(
            manifest.all_joints, coupling.matrix, coupling.offset, strict=True
        )
        if joint.name not in names
    }
