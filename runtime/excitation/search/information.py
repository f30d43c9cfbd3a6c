"""Information of a motion about chosen unknowns, together with that of earlier logs.

Torque with white noise of standard deviation σ_j on joint j, sampled at a rate f for t_f seconds,
gives least squares the information Tᵀ (f t_f · mean_k Y_bᵀ diag(σ⁻²) Y_b + G₀) T: its inverse is
the covariance of the unknowns x in β = β₀ + T x. G₀ comes from earlier logs; T selects unknowns,
such as the ten of a payload on an arm that is known. Friction and offset of every joint are unknown
too: the part of Y_b that their columns explain determines nothing, and is projected out of it
(`nuisance`). For coloured noise and a planned filter rows and columns count frequency by frequency
(`noise_spectrum`).
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.search.noise_spectrum import NoiseSpectrum
from runtime.excitation.search.nuisance import require_of_speed
from runtime.library import Array, Library
from runtime.recording import Friction
from runtime.recording.friction import OFFSET

NOISE = 0.05
"""Default torque noise, N·m or N."""
RATE = 100.0
"""Default sampling rate of the log, Hz."""
FRICTION = Friction().columns
"""Friction columns that are estimated beside base parameters."""


@dataclass(frozen=True, slots=True)
class Information:
    """Data from which the regressor of a motion becomes information.

    Attributes:
        noise: σ, (n,) N·m or N.
        rate: f, Hz.
        earlier: G₀ of earlier logs over β, (n_b, n_b); None without.
        columns: T, (n_b, k); None is the identity.
        left_out: places in β of the parameters that T leaves out one by one, because no motion
            shows them (`unseen_parameters`); empty where T is a payload's.
        friction: columns of every joint that are estimated beside the unknowns.
        spectrum: of the noise, and the planned filter; None is white noise and no filter.
    """

    noise: Array
    rate: float = RATE
    earlier: Array | None = None
    columns: Array | None = None
    friction: tuple[str, ...] = ()
    spectrum: NoiseSpectrum | None = None
    left_out: tuple[int, ...] = ()

    def of_mean(self, mean: Array, duration: float) -> Array:
        """Information of the unknowns.

        Args:
            mean: mean_k Y_bᵀ diag(σ⁻²) Y_b of rows without the part along friction columns,
                (..., n_b, n_b).
            duration: t_f, s.

        Returns:
            (..., k, k).
        """
        gram = mean * (self.rate * duration)
        if self.earlier is not None:
            gram = gram + self.earlier
        return gram if self.columns is None else self.columns.T @ gram @ self.columns

    def to_mean(self, slope: Array, duration: float) -> Array:
        """Adjoint of `of_mean`: ∂f/∂mean from ∂f/∂information.

        Args:
            slope: ∂f/∂information, (..., k, k).
            duration: t_f, s.

        Returns:
            (..., n_b, n_b).
        """
        if self.columns is not None:
            slope = self.columns @ slope @ self.columns.T
        return slope * (self.rate * duration)


def information(
    lib: Library,
    noise: float | Array = NOISE,
    rate: float = RATE,
    earlier: Array | None = None,
    payload: bool = False,
    friction: tuple[str, ...] | None = None,
) -> Information:
    """Information with its numbers checked.

    Args:
        lib: the robot.
        noise: one σ or one per joint, N·m or N.
        rate: Hz.
        earlier: G₀ of earlier logs over β, (n_b, n_b), or None.
        payload: the ten parameters of the last link are the only unknown inertial parameters.
        friction: columns of every joint that are estimated too; None is `FRICTION`, and with
            `payload` the offset alone, because the friction of a known arm is known.

    Returns:
        The information.

    Raises:
        RuntimeFault: a noise, a rate, a matrix or a friction column without a meaning.
    """
    sigma = np.asarray(noise, dtype=float)
    if sigma.shape not in {(), (1,), (lib.n_joints,)} or not (
        np.isfinite(sigma).all() and (sigma > 0).all()
    ):
        raise IdentificationError(
            f"expected a torque noise above 0 N·m, one number or {lib.n_joints} of them, got "
            f"{np.array2string(sigma, separator=', ')}; {NOISE} is usual"
        )
    if not (np.isfinite(rate) and rate > 0):
        raise IdentificationError(f"expected a sampling rate above 0 Hz, got {rate:g}")
    n_base = len(lib.base_columns)
    if earlier is not None and (
        earlier.shape != (n_base, n_base) or not np.isfinite(earlier).all()
    ):
        raise IdentificationError(
            f"expected information of earlier logs of shape ({n_base}, {n_base}), finite, "
            f"got {earlier.shape}; make it from logs of this robot"
        )
    columns = lib.base_matrix[:, -10:] if payload else None
    if friction is None:
        friction = (OFFSET.name,) if payload else FRICTION
    require_of_speed(friction)
    noises = np.broadcast_to(sigma, lib.n_joints).copy()
    return Information(noises, rate, earlier, columns, friction)
