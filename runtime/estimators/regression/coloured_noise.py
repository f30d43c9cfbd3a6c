"""How loud the noise is where a fit listens: at the frequencies that its columns have.

A fit with the hat matrix H = Q Qᵀ leaves r = (1 − H) e of coloured noise e. Orthonormal cosines of
time, ^, spread both over frequencies f; column by column, h = Σ_k q̂_k² is the share of one
equation that the fit takes up there, and E r̂² = S(f) (1 − h). What counts for the unknowns is the
mean of the spectrum S over their own frequencies, tr(Qᵀ cov(e) Q) / p, hence

    S = Σ h r̂² / Σ h (1 − h),   σ² = (‖r‖² + p S) / (n N),   N_eff = N σ² / S

exact for white noise, and for coloured noise as far as S(f) is even where h is not zero: slow
patterns that the fit has swallowed are missed in the sum above and in the one below alike. A
spectrum at frequency zero over fixed lags would count them as silence.
Source: Bartlett 1950 for smoothed periodograms, Müller 2007 for cosines; the weights h are ours.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import dct, next_fast_len

from runtime.estimators.regression import Statistics
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

PIECE, MOST = 1024, 8
"""Rows that are transformed together, and how many such pieces are taken evenly of a long log:
they know S to some percent, in some ten milliseconds."""
RANK_TOLERANCE = 1e-9
"""Relative size below which a direction of unit columns counts as silent."""
_LEAST = 0.02
"""Part of the columns' own frequencies that their fit leaves over, below which nothing is heard."""


@dataclass(frozen=True, slots=True)
class Colour:
    """Of the noise in rows over their weights.

    Attributes:
        level: S, the variance with which the noise enters the unknowns.
        variance: σ², that of a row.
    """

    level: float
    variance: float

    @property
    def inflation(self) -> float:
        """N / N_eff = S/σ²: 1 for white noise, above 1 for low-passed noise."""
        return self.level / self.variance if self.level > 0 and self.variance > 0 else 1.0


def colour_of(
    lib: Library, parts: Sequence[Samples], statistics: Statistics, weights: Array
) -> Colour:
    """Of what base parameters and friction leave by least squares; no model is asked.

    Args:
        lib: of the robot.
        parts: samples of the statistics, or stretches of them.
        statistics: of all samples.
        weights: diagonal of W in them, (n,).
    """
    unit, lengths = statistics.unit_columns()
    space, root = _orthonormal(unit)
    root = root / lengths[:, None]
    x, scale = root @ (space.T @ statistics.target), np.sqrt(weights)

    def piece(samples: Samples) -> tuple[Array, Array]:
        rows = np.concatenate([samples.base_rows(lib), samples.friction_rows()], axis=2)
        rows *= scale[:, None]
        return rows @ root, rows @ x - samples.tau * scale

    pieces = (piece(part.rows(own)) for part in parts for own in _pieces(len(part), len(parts)))
    equations = statistics.n_samples * len(weights)
    return _colour([_heard(*one) for one in pieces], statistics.rest, root.shape[1], equations)


def colour_of_rows(rows: Array, target: Array) -> Colour:
    """The same of any linear fit whose rows fit into memory.

    Args:
        rows: columns over the noise, (N, n, p).
        target: what they are to explain, or any fit leaves of it, over the noise, (N, n).
    """
    count, n, p = rows.shape
    flat = rows.reshape(count * n, p)
    lengths = np.linalg.norm(flat, axis=0)
    flat = flat / np.where(lengths > 0, lengths, 1.0)
    triangle: Array = np.asarray(np.linalg.qr(flat, mode="r"))
    _, root = _orthonormal(triangle)
    q, flat_target = flat @ root, target.ravel()
    rest = flat_target - q @ (q.T @ flat_target)
    return colour_of_basis([(q.reshape(count, n, -1), rest.reshape(count, n))], 1)


def colour_of_basis(stretches: Iterable[tuple[Array, Array]], parts: int) -> Colour:
    """The same from an orthonormal basis (N, n, p) of the columns and the rest (N, n), in parts."""
    sums, power, equations, unknowns = [], 0.0, 0, 0
    for q, rest in stretches:
        sums += [_heard(q[own], rest[own]) for own in _pieces(len(q), parts)]
        power += float(np.sum(rest**2))
        equations += rest.size
        unknowns = q.shape[2]
    return _colour(sums, power, unknowns, equations)


def _colour(
    sums: list[tuple[float, float, float]], power: float, unknowns: int, equations: float
) -> Colour:
    white = power / max(equations - unknowns, 1.0)
    loud, left, taken = np.sum(sums, axis=0) if sums else (0.0, 0.0, 0.0)
    if not left > _LEAST * taken:
        return Colour(white, white)
    level = float(loud / left)
    return Colour(level, (power + unknowns * level) / equations)


def _heard(q: Array, rest: Array) -> tuple[float, float, float]:
    """Σ h r̂², Σ h (1 − h) and Σ h of one piece."""
    waves = dct(q, axis=0, norm="ortho")
    h = np.einsum("ijk,ijk->ij", waves, waves)
    loud = dct(rest, axis=0, norm="ortho") ** 2
    return float(np.sum(h * loud)), float(np.sum(h * (1 - h))), float(np.sum(h))


def _orthonormal(unit: Array) -> tuple[Array, Array]:
    """U and R of unit = U R⁻¹, columns over unit columns, without their silent directions."""
    space, sizes, turn = np.linalg.svd(unit, full_matrices=False)
    seen = sizes > RANK_TOLERANCE * max(float(sizes.max(initial=0.0)), 1e-300)
    return space[:, seen], turn[seen].T / sizes[seen]


def _pieces(count: int, parts: int) -> Iterator[slice]:
    """Evenly spread, of a length that the transform likes, about MOST of all parts together."""
    number = min(max(1, MOST // parts), -(-count // PIECE))
    if not number:
        return
    shortest = count // number
    length = next(k for k in range(min(PIECE, shortest), 0, -1) if next_fast_len(k, True) == k)
    for start in np.linspace(0, count - length, number).astype(int):
        yield slice(int(start), int(start) + length)
