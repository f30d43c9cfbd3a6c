"""Samples → statistics in one pass, block by block; Y_b is never stored."""

from collections import deque
from collections.abc import Callable, Iterable
from itertools import chain, islice
from typing import TYPE_CHECKING

import numpy as np

from runtime.common.threads import cores
from runtime.errors import IdentificationError
from runtime.estimators.regression.factor import Statistics, from_triangle, joined
from runtime.estimators.regression.samples import Samples
from runtime.estimators.regression.torque_objective import TorqueObjective
from runtime.library import Array, Library

if TYPE_CHECKING:
    from concurrent.futures import Future

TOGETHER = 16
"""Number of factors that are collected before they are joined."""
BLOCK = 16384
"""Samples per factor, of the last one half to one and a half as many: fixed, so that the number of
threads changes nothing, and some milliseconds of work, against which joining factors and starting
threads are negligible."""
TRIED = 8
"""Blocks that find out by themselves whether rows may be multiplied; if none may, no later one
tries, which takes a twentieth of its time. Fixed, as `BLOCK`."""


def compress(
    lib: Library,
    samples: Samples,
    weights: Array,
    sample_weights: Array | None = None,
    threads: int | None = None,
) -> Statistics:
    """Compress N samples; the result does not depend on `threads`, to the bit.

    Args:
        lib: library of the robot.
        samples: motion, torque and friction columns.
        weights: diagonal of W, (n,).
        sample_weights: weight s of each sample, (N,); None for ones.
        threads: default is one per processor, as far as there are blocks for them.

    Returns:
        The statistics.

    Raises:
        IdentificationError: weights are negative or not finite, or samples are not finite.
    """
    weights = _weights("weights", weights, samples.equations)
    count = float(len(samples))
    if sample_weights is not None:
        sample_weights = _weights("sample_weights", sample_weights, len(samples))
        count = float(sample_weights.sum())
    compiled = lib.compiled_statistics
    join: Callable[[Array], Array] = compiled.join if compiled else joined

    def block(start: int, products: bool = True) -> tuple[Array, int]:
        part = slice(start, start + BLOCK if start < starts[-1] else None)
        s = samples.rows(part)
        counts = None if sample_weights is None else sample_weights[part]
        # The C code evaluates Y_b itself and takes columns of one joint each.
        if compiled is None or s.coupling is not None or s.base is not None:
            return reference_triangle(lib, s, weights, counts), 0
        return compiled.triangle(s.q, s.dq, s.ddq, s.tau, s.columns, weights, counts, products)

    # One factor per block, on threads, then the factor of all factors.
    starts = range(0, max(round(len(samples) / BLOCK), 1) * BLOCK, BLOCK)
    workers = min(len(starts), threads or cores()) if len(starts) > 1 else 1

    def all_blocks(each: Callable[..., Iterable[tuple[Array, int]]]) -> list[Array]:
        done = list(each(block, starts[:TRIED]))
        products = any(multiplied for _, multiplied in done)
        done += each(lambda start: block(start, products), starts[TRIED:])
        return [triangle for triangle, _ in done]

    if workers > 1:
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(workers) as pool:
            triangles = all_blocks(pool.map)
    else:
        triangles = all_blocks(map)
    triangle = triangles[0] if len(triangles) == 1 else join(np.stack(triangles))
    if not np.isfinite(triangle).all():
        raise IdentificationError(
            "the samples hold NaN, infinite or far too large values; drop those rows before "
            "compressing them"
        )
    return from_triangle(triangle, count, lib.base_matrix, lib.manifest.model_hash)


def compress_all(lib: Library, pieces: Iterable[Samples], weights: Array) -> Statistics:
    """Compress many pieces into one, with a bounded number of factors in memory.

    Args:
        lib: library of the robot.
        pieces: samples, piece by piece.
        weights: diagonal of W, (n,).

    Returns:
        Statistics of all pieces together.

    Raises:
        IdentificationError: as `compress`, or there is no piece.
    """
    source = iter(pieces)
    first = tuple(islice(source, 2))
    if len(first) == 1:  # a short log; threads take longer to start than it takes
        return compress(lib, first[0], weights)
    from concurrent.futures import ThreadPoolExecutor

    factors: list[Statistics] = []
    with ThreadPoolExecutor(cores()) as pool:
        # Pieces are taken by this thread, a bounded number ahead, and compressed on the others.
        source, waiting = chain(first, source), deque["Future[Statistics]"]()
        while True:
            for piece in islice(source, 2 * cores() - len(waiting)):
                waiting.append(pool.submit(compress, lib, piece, weights))
            if not waiting:
                break
            factors.append(waiting.popleft().result())
            if len(factors) == TOGETHER:
                factors = [factors[0].merged(*factors[1:])]
    if not factors:
        raise IdentificationError("there are no samples to compress; use another --split")
    return factors[0].merged(*factors[1:]) if len(factors) > 1 else factors[0]


def reference_triangle(
    lib: Library, samples: Samples, weights: Array, sample_weights: Array | None
) -> Array:
    """Triangle of samples by NumPy, from explicit rows [F Y_b τ]; the reference of the C code.

    Args:
        lib: library of the robot.
        samples: N samples.
        weights: diagonal of W, (n,).
        sample_weights: weight of each sample, (N,); None for ones.

    Returns:
        Upper triangle over [φ; β; τ], (p + 1, p + 1).
    """
    rows = np.concatenate(
        [samples.friction_rows(), samples.base_rows(lib), samples.tau[:, :, None]], axis=2
    )
    rows *= np.sqrt(weights)[:, None]
    if sample_weights is not None:
        rows *= np.sqrt(sample_weights)[:, None, None]
    return joined(rows.reshape(1, -1, rows.shape[2]))


class CompressedObjective:
    """L(x) and ∇L(x) from compressed statistics: the cost does not depend on N."""

    def __init__(self, whole: TorqueObjective, statistics: Statistics) -> None:
        self.whole, self.statistics = whole, statistics

    def value_gradient(self, x: Array) -> tuple[float, Array]:
        """L and ∇L over all samples."""
        lib, s = self.whole.lib, self.statistics
        lam, phi = self.whole.split(x)
        residual = s.residual(lib.pi_from_lam(lam), phi)
        slope = s.factor.T @ residual / s.n_samples
        n_lam = lib.pi_adjoint(lam, slope[: s.n_base] @ s.base_matrix)
        n_phi = slope[s.n_base :] * self.whole.unit.ravel()
        value = (residual @ residual + s.rest) / (2 * s.n_samples)
        return float(value), np.concatenate([n_lam, n_phi])


def _weights(name: str, values: Array, size: int) -> Array:
    """Weights (size,) as finite numbers that are at least 0."""
    weights = np.ascontiguousarray(values, dtype=float)
    if weights.shape != (size,) or not (np.isfinite(weights) & (weights >= 0)).all():
        raise IdentificationError(
            f"expected {name} of shape ({size},), finite and at least 0, got shape "
            f"{weights.shape}; use ones to weight all rows equally"
        )
    return weights
