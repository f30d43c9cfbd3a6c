"""Sum of the vertical contact forces: measured, by the URDF and by the identified model."""

from dataclasses import dataclass

import numpy as np

from runtime.identification.free_base.rows import contact_jacobian
from runtime.identification.free_base.vertical_sensors import reading_errors
from runtime.library import Array, Library
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion


@dataclass(frozen=True, slots=True, eq=False)
class VerticalForce:
    """Sum of the vertical contact forces on the test part.

    Attributes:
        weight: mean of the measured sum [N].
        before: RMS error of the URDF's prediction [N].
        after: RMS error of the identified model's prediction, errors of the sensors included [N].
        spread: standard deviation of the measured sum, the error of the best constant [N].
        measured, predicted: the sums, measured and by the URDF, (N,) [N].
    """

    weight: float
    before: float
    after: float
    spread: float
    measured: Array
    predicted: Array


def vertical_force(
    lib: Library, motion: FreeBaseMotion, pi: Array, phi: Array
) -> VerticalForce | None:
    """Errors of ΣF_z, the vertical component of the forces on the base."""
    contacts = motion.contacts
    if not contacts.links:
        return None
    wrench = contacts.wrench
    if contacts.axes == "world":
        if np.isnan(wrench[:, :, 2]).any():
            return None
        measured = wrench[:, :, 2].sum(axis=1)
    else:
        if np.isnan(wrench[:, :, :3]).any():
            return None
        count = len(motion)
        force = np.where(np.isnan(wrench), 0.0, wrench)
        on_base = np.einsum("nck,nc->nk", contact_jacobian(lib, motion), force.reshape(count, -1))
        measured = np.einsum("ni,ni->n", motion.rotation[:, 2], on_base[:, :3])
    if not measured.any():
        return None

    def predicted(parameters: Array) -> Array:
        force = lib.inverse_dynamics(motion.q, motion.dq, motion.ddq, parameters)[:, :3]
        return np.einsum("ni,ni->n", motion.rotation[:, 2], force)

    by_urdf = predicted(lib.pi0)
    return VerticalForce(
        float(measured.mean()),
        float(rms(by_urdf - measured)),
        float(rms(predicted(pi) + (reading_errors(lib, motion) @ phi[0]).sum(axis=1) - measured)),
        float(measured.std()),
        measured,
        by_urdf,
    )


def rms(values: Array) -> Array:
    """Root of the mean square over the first axis."""
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=0)))
