"""Rows at the frequencies of the motion.

Noise of positions enters the columns of a fit through their derivatives, grows with the square of
the frequency, and times β enters the residual, too. Of a column that others take up nearly whole
that noise is most of what is left, and it correlates with the residual. Columns of the slow cosines
of time that the motion has are nearly free of it, and hold all that the motion determines.
Source: Fuller 1987 for errors in variables, Müller 2007 for cosines.
"""

import numpy as np
from scipy.fft import dct, idct

from runtime.estimators.regression.samples import Samples
from runtime.library import Array

BAND_HZ, OF_SPEED = 6.0, 0.99
"""Band of the motion of an arm [Hz], and least share of the power of the speeds that it holds. From
6 Hz on, causes on a real Panda have their whole T; clean cuts of 2.5 to 5 s with 2e-5 rad of noise
name 2 causes in 132 at 6 Hz, 4 at 8 and 11 at 12."""
ENOUGH = 1.5
"""Least number of slow equations per unknown: fewer leave no estimate of the noise."""


def slow_part(columns: Array, cosines: int) -> Array:
    """The first cosines of time of columns (N, ...), without the faster ones."""
    if cosines >= len(columns):
        return columns
    waves = dct(columns, axis=0, norm="ortho")
    waves[cosines:] = 0.0
    return np.asarray(idct(waves, axis=0, norm="ortho"))


def slow_cosines(samples: Samples) -> int:
    """Number of cosines of time of the motion; at most that of the samples."""
    power = np.cumsum(np.sum(dct(samples.dq, axis=0, norm="ortho") ** 2, axis=1))
    fastest = int(np.searchsorted(power, OF_SPEED * power[-1]))
    step = time_step(samples) or np.inf
    return int(min(max(2 * BAND_HZ * step * len(samples), fastest) + 1, len(samples)))


def tells(samples: Samples, cosines: int, unknowns: int) -> bool:
    """Whether the slow equations of all joints leave an estimate of the noise beside unknowns."""
    return cosines * samples.equations >= ENOUGH * unknowns


def time_step(samples: Samples) -> float:
    """Mean time step [s]: 2 h = ⟨q_(i+1) − q_(i−1), dq_i⟩ / ⟨dq_i, dq_i⟩; 0 at rest."""
    moved, speed = (samples.q[2:] - samples.q[:-2]).ravel(), samples.dq[1:-1].ravel()
    return max(float(moved @ speed) / max(float(speed @ speed), 1e-300) / 2, 0.0)
