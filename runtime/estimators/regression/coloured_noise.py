"""Coloured noise of a linear fit: its density at the frequencies of the fitted columns.

A fit with the hat matrix H = Q Qᵀ leaves r = (1 − H) e of coloured noise e. Orthonormal cosines of
time, ^, spread both over frequencies f; column by column, h = Σ_k q̂_k² is the share of one
equation that the fit takes up there, and E r̂² = S(f) (1 − h). What counts for the unknowns is the
mean of the spectrum S over their own frequencies, tr(Qᵀ cov(e) Q) / p, hence

    S = Σ h r̂² / Σ h (1 − h),   σ² = (‖r‖² + p S) / (n N),   N_eff = N σ² / S

exact for white noise, and for coloured noise as far as S(f) is even where h is not zero: slow
patterns that the fit has absorbed are missing in the sum above and in the one below alike. A
spectrum at frequency zero over fixed lags would count them as noise-free. For some unknowns alone
the sums are weighted by h of their own directions, those orthogonal to all other columns.
Source: Bartlett 1950 for smoothed periodograms, Müller 2007 for cosines; the weights h are ours.

Noise of positions enters the columns of a fit through their derivatives, grows with the square of
the frequency, and times β enters the residual, too. Of a column that others take up nearly whole
that noise is most of what is left, and it correlates with the residual. Columns of the slow cosines
of time that the motion has (`slow_part`) are nearly free of it, and hold all that the motion
determines. Source: Fuller 1987 for errors in variables, Müller 2007 for cosines.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import dct, idct, next_fast_len

from runtime.estimators.regression import posterior
from runtime.estimators.regression.factor import Statistics
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

PIECE, MOST = 1024, 8
"""Rows that are transformed together, and number of such pieces, evenly spread over a long log:
enough for S to some percent within some ten milliseconds."""
FEW = 1.0  # frequencies that the mean of all equations counts as, beside those of one of them
_LEAST = 0.02  # share Σ h (1 − h) / Σ h left over by the fit below which S cannot be estimated


@dataclass(frozen=True, slots=True)
class ColouredNoise:
    """Noise of rows that are divided by their standard deviation."""

    density: float  # S, the variance with which the noise enters the unknowns
    variance: float  # σ², the variance of a row

    @property
    def inflation(self) -> float:
        """N / N_eff = S/σ²: 1 for white noise, above 1 for low-passed noise."""
        return self.density / self.variance if self.density > 0 and self.variance > 0 else 1.0


def coloured_noise_of(
    lib: Library,
    parts: Sequence[Samples],
    statistics: Statistics,
    weights: Array,
    only_base: bool = False,
) -> ColouredNoise:
    """Noise of what least squares over base parameters and friction leaves; no model is needed."""
    # Orthonormal basis Q = rows · root of the columns, from the triangular factor.
    fit = posterior.posterior_of(statistics.factor, statistics.target)
    root, scale = fit.root, np.sqrt(weights)
    # Directions of the base parameters: columns of Y_b without their part along F.
    directions = None
    if only_base:
        unit, _ = statistics.unit_columns()
        first, others = unit[:, : statistics.n_base], unit[:, statistics.n_base :]
        apart = posterior.least_squares(others, first)[1]
        apart = posterior.orthonormal(apart, lengths=np.ones(statistics.n_base))
        directions = (statistics.factor @ root).T @ apart

    def basis_and_rest(samples: Samples) -> tuple[Array, Array, Array | None]:
        rows = samples.rows_of_unknowns(lib) * scale[:, None]
        some = None if directions is None else posterior.basis_of_joints(rows, root @ directions)
        return posterior.basis_of_joints(rows, root), rows @ fit.mean - samples.tau * scale, some

    pieces = (
        basis_and_rest(part.rows(rows)) for part in parts for rows in _pieces(len(part), len(parts))
    )
    sums = [_spectral_sums(*piece) for piece in pieces]
    equations = statistics.n_samples * len(weights)
    return _noise_from_sums(sums, statistics.rest, root.shape[1], equations)


def coloured_noise_of_rows(rows: Array, target: Array) -> ColouredNoise:
    """Noise of a linear fit whose rows fit into memory."""
    count, n, p = rows.shape
    q, flat_target = posterior.orthonormal(rows.reshape(count * n, p)), target.ravel()
    rest = flat_target - q @ (q.T @ flat_target)
    return coloured_noise_of_basis([(q.reshape(count, n, -1), rest.reshape(count, n))], 1)


def coloured_noise_of_basis(
    stretches: Iterable[tuple[Array, Array]], parts: int, unknowns: int | None = None
) -> ColouredNoise:
    """Noise of a linear fit from an orthonormal basis of its columns."""
    sums, power, equations, width = [], 0.0, 0, 0
    for q, rest in stretches:
        sums += [_spectral_sums(q[rows], rest[rows]) for rows in _pieces(len(q), parts)]
        power += float(np.sum(rest**2))
        equations += rest.size
        width = q.shape[2]
    return _noise_from_sums(sums, power, width if unknowns is None else unknowns, equations)


def densities_of_basis(q: Array, rest: Array) -> Array:
    """S of every equation (n,), drawn to that of all as if `FEW` more frequencies showed it.

    q (N, n, p) orthonormal, rest (N, n). The colours of joints differ: noise of positions enters a
    heavy one by its accelerations, a light one has that of its sensor.
    """
    sums = [_spectral_sums(q[rows], rest[rows]) for rows in _pieces(len(q), 1)]
    mean = _noise_from_sums(sums, float(np.sum(rest**2)), q.shape[2], rest.size).density
    weighted, left, _ = np.sum(sums, axis=0)
    return np.asarray((weighted + FEW * mean) / (left + FEW))


def shares_of_basis(q: Array) -> tuple[Array, ...]:
    """Share of every frequency that a fit takes up; those of orthogonal columns add up.

    q (N, n, p) → (N_i, n).
    """
    return tuple(_taken_up(q[rows]) for rows in _pieces(len(q), 1))


def coloured_noise_of_shares(shares: Sequence[Array], rest: Array, unknowns: int) -> ColouredNoise:
    """Noise of a linear fit to one stretch of samples, from the shares of its columns."""
    sums = [_sums(h, h, rest[rows]) for h, rows in zip(shares, _pieces(len(rest), 1), strict=True)]
    return _noise_from_sums(sums, float(np.sum(rest**2)), unknowns, rest.size)


def _noise_from_sums(
    sums: Sequence[Array], power: float, unknowns: int, equations: float
) -> ColouredNoise:
    """S = Σ h r̂² / Σ h (1 − h) and σ² = (‖r‖² + p S) / (n N)."""
    white = power / max(equations - unknowns, 1.0)
    weighted, left, taken = np.sum(sums, axis=(0, 2)) if sums else (0.0, 0.0, 0.0)
    # A fit that absorbs almost all at its frequencies leaves no estimate: white noise is assumed.
    if not left > _LEAST * taken:
        return ColouredNoise(white, white)
    density = float(weighted / left)
    return ColouredNoise(density, (power + unknowns * density) / equations)


def _spectral_sums(q: Array, rest: Array, some: Array | None = None) -> Array:
    """Σ g r̂², Σ g (1 − h) and Σ g of every equation of one piece, q (N, n, p) and rest (N, n).

    g is h of the basis of some unknowns alone, (N, n, m); h itself without them.
    """
    h = _taken_up(q)
    return _sums(h, h if some is None else _taken_up(some), rest)


def _sums(h: Array, g: Array, rest: Array) -> Array:
    """Σ g r̂², Σ g (1 − h) and Σ g of shares (N, n) and residuals (N, n), (3, n)."""
    power = dct(rest, axis=0, norm="ortho") ** 2
    return np.array([np.sum(each, axis=0) for each in (g * power, g * (1 - h), g)])


def _taken_up(q: Array) -> Array:
    """Σ_k q̂_k², the share of every frequency and joint, (N, n)."""
    waves = dct(q, axis=0, norm="ortho")
    return np.asarray(np.einsum("ijk,ijk->ij", waves, waves))


def _pieces(count: int, parts: int) -> Iterator[slice]:
    """Evenly spread pieces of a length that is fast to transform, about MOST of all parts."""
    number = min(max(1, MOST // parts), -(-count // PIECE))
    if not number:
        return
    shortest = count // number
    length = next(k for k in range(min(PIECE, shortest), 0, -1) if next_fast_len(k, True) == k)
    for start in np.linspace(0, count - length, number).astype(int):
        yield slice(int(start), int(start) + length)


BAND_HZ, OF_SPEED = 6.0, 0.99
"""Band of the motion of an arm [Hz], and least share of the power of the speeds that it holds. From
6 Hz on, causes on a real Panda have their whole T; clean cuts of 2.5 to 5 s with 2e-5 rad of noise
name 2 causes in 132 at 6 Hz, 4 at 8 and 11 at 12."""
ENOUGH = 1.5  # least number of slow equations per unknown: fewer leave no estimate of the noise


def slow_part(columns: Array, cosines: int) -> Array:
    """The first cosines of time of columns (N, ...), without the faster ones."""
    if cosines >= len(columns):
        return columns
    waves = dct(columns, axis=0, norm="ortho")
    waves[cosines:] = 0.0
    return np.asarray(idct(waves, axis=0, norm="ortho"))


def slow_cosines(samples: Samples, least_hz: float = BAND_HZ) -> int:
    """Number of cosines of time of the motion, at least of `least_hz`, at most of the samples."""
    power = np.cumsum(np.sum(dct(samples.dq, axis=0, norm="ortho") ** 2, axis=1))
    fastest = int(np.searchsorted(power, OF_SPEED * power[-1]))
    step = time_step(samples) or np.inf
    return int(min(max(2 * least_hz * step * len(samples), fastest) + 1, len(samples)))


def tells(equations: int, cosines: int, unknowns: int) -> bool:
    """Whether the slow equations of all joints leave an estimate of the noise beside unknowns."""
    return cosines * equations >= ENOUGH * unknowns


def time_step(samples: Samples) -> float:
    """Mean time step [s]: 2 h = ⟨q_(i+1) − q_(i−1), dq_i⟩ / ⟨dq_i, dq_i⟩; 0 at rest."""
    moved, speed = (samples.q[2:] - samples.q[:-2]).ravel(), samples.dq[1:-1].ravel()
    return max(float(moved @ speed) / max(float(speed @ speed), 1e-300) / 2, 0.0)
