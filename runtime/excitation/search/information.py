"""Information of a motion about chosen unknowns, together with that of earlier logs.

Torque with white noise of standard deviation σ_j on joint j, sampled at a rate f for t_f seconds,
gives least squares the information Tᵀ (f t_f · mean_k Y_bᵀ diag(σ⁻²) Y_b + G₀) T: its inverse is
the covariance of the unknowns x in β = β₀ + T x. G₀ comes from earlier logs; T selects unknowns,
such as the ten of a payload on an arm that is known. Friction and offset of every joint are unknown
too: the part of Y_b that their columns explain determines nothing, and is projected out of it
(`nuisance`). For coloured noise and a planned filter rows and columns count frequency by frequency:

    G = Σ_k w(f_k)² ŷ_kᵀ ŷ_k / σ²,    w² = |H(f)|² σ² / S(f),    f_k = k / 2T

ŷ_k are orthonormal cosines of the rows over their time T. A motion out and back is even in time:
the cosines of its first half are its harmonics k / t_f, and the sum is exact. S is the density of
the noise of joint j per row, σ² for white noise; friction that no column describes, gains and
delays are part of the S of a log. H is the zero-phase Butterworth filter of the fourth order that
the log will pass: what a motion has beyond its cut-off determines nothing.
Source: Pintelon & Schoukens 2012, Ch. 2 (information of periodic excitation in coloured noise).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.fft import dct

from runtime.errors import IdentificationError
from runtime.excitation.search.nuisance import require_of_speed
from runtime.library import Array, Library
from runtime.recording import Friction
from runtime.recording.friction import OFFSET

ORDER = 4
"""Order of the filter, which runs forwards and backwards."""
BANDS, LEAST_BINS = 24, 16
"""Bands of an estimated spectrum, equally wide in log f, and the least number of bins in one."""
NOISE = 0.05
"""Default torque noise, N·m or N."""
RATE = 100.0
"""Default sampling rate of the log, Hz."""
FRICTION = Friction().columns
"""Friction columns that are estimated beside base parameters."""


@dataclass(frozen=True, slots=True, eq=False)
class NoiseSpectrum:
    """Noise density over frequency, and the planned filter.

    Attributes:
        frequency: centres of bands, (B,) Hz, rising; empty for white noise.
        density: S / σ² of every joint, (B, n).
        cutoff_hz: of the planned low-pass; None without.

    Raises:
        IdentificationError: a cut-off that is not above 0.
    """

    frequency: Array
    density: Array
    cutoff_hz: float | None = None

    def __post_init__(self) -> None:
        if self.cutoff_hz is not None and not 0 < self.cutoff_hz < np.inf:
            raise IdentificationError(
                f"expected a cut-off above 0 Hz, got {self.cutoff_hz:g}; 10 Hz is usual"
            )

    def amplitudes(self, frequency: Array) -> Array:
        """w(f) of every joint.

        frequency (F,) → (F, n).
        """
        weight = np.ones((len(frequency), 1))
        if len(self.frequency):
            weight = np.stack(
                [np.interp(frequency, self.frequency, one) for one in self.density.T], axis=1
            )
            weight = 1 / np.sqrt(weight)
        if self.cutoff_hz is not None:
            weight = weight / (1 + (frequency / self.cutoff_hz) ** (2 * ORDER))[:, None]
        return np.asarray(weight)

    def weighted_cosines(self, count: int, step: float) -> Array:
        """Matrix A with G = Σ_j (A_j Y_j)ᵀ (A_j Y_j) / σ_j²."""
        frequency = np.arange(count) / (2 * count * step)
        turn = dct(np.eye(count), axis=0, norm="ortho")
        return np.asarray(self.amplitudes(frequency).T[:, :, None] * turn)


@dataclass(frozen=True, slots=True)
class Information:
    """Data from which the regressor of a motion becomes information."""

    noise: Array  # σ, (n,) N·m or N
    rate: float = RATE  # f, Hz
    earlier: Array | None = None  # G₀ of earlier logs over β, (n_b, n_b); None without
    columns: Array | None = None  # T, (n_b, k); None is the identity
    friction: tuple[str, ...] = ()  # columns of every joint that are estimated beside the unknowns
    # of the noise, and the planned filter; None is white noise and no filter
    spectrum: NoiseSpectrum | None = None
    # places in β of the parameters that T leaves out one by one, because no motion shows them
    # (`unseen_parameters`); empty where T is a payload's
    left_out: tuple[int, ...] = ()

    def of_mean(self, mean: Array, duration: float) -> Array:
        """Information of the unknowns."""
        gram = mean * (self.rate * duration)
        if self.earlier is not None:
            gram = gram + self.earlier
        return gram if self.columns is None else self.columns.T @ gram @ self.columns

    def to_mean(self, slope: Array, duration: float) -> Array:
        """Adjoint of `of_mean`: ∂f/∂mean from ∂f/∂information."""
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
    """Information with its numbers checked."""
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


def spectrum_of(rest: Array, rate: float, cutoff_hz: float | None = None) -> NoiseSpectrum:
    """Spectrum of the residuals of a log.

    rest (N, n) [N·m, N].
    """
    power = dct(rest, axis=0, norm="ortho") ** 2
    count = len(power)
    edges = np.unique(np.round(np.geomspace(LEAST_BINS, count, BANDS + 1)).astype(int))
    edges = np.concatenate([[0], edges[:1], edges[1:][np.diff(edges) >= LEAST_BINS]])
    edges[-1] = count
    bands = list(pairwise(edges.tolist()))
    density = np.array([power[a:b].mean(axis=0) for a, b in bands]) / power.mean(axis=0)
    frequency = np.array([(a + b - 1) / 2 for a, b in bands]) * rate / (2 * count)
    # Where the filter has removed the noise, its density is that of the last band before.
    kept = frequency <= (np.inf if cutoff_hz is None else max(cutoff_hz, frequency[0]))
    return NoiseSpectrum(frequency[kept], density[kept], cutoff_hz)
