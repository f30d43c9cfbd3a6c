"""Spectrum of the torque noise and the planned filter, as weights of the frequencies of a motion.

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
from runtime.library import Array

ORDER = 4
"""Order of the filter, which runs forwards and backwards."""
BANDS, LEAST_BINS = 24, 16
"""Bands of an estimated spectrum, equally wide in log f, and the least number of bins in one."""


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
