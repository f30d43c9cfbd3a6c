"""Samples → statistics, in one pass; Y_b is never stored."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression.factor import Statistics, from_triangle, joined
from runtime.estimators.regression.samples import Samples
from runtime.estimators.regression.torque_objective import TorqueObjective
from runtime.library import Array, Library
from runtime.parallel import cores

TOGETHER = 16
"""Factors of pieces that wait until they are joined."""
BLOCK = 8192
"""Samples per factor of its own: fixed, so that threads change nothing, and some milliseconds of
work, next to which neither joining two factors nor handing one to a thread counts."""


def compress(
    lib: Library,
    samples: Samples,
    weights: Array,
    sample_weights: Array | None = None,
    threads: int | None = None,
) -> Statistics:
    """Statistics of N samples; the result does not depend on `threads`, to the bit.

    Args:
        lib: of the robot.
        samples: motion, torque and friction columns.
        weights: diagonal of W, (n,).
        sample_weights: s, (N,), each sample's own weight; None for ones.
        threads: default is one per processor, as far as there are blocks for them.

    Raises:
        IdentificationError: weights that are none, or samples that are not finite.
    """
    weights = _weights("weights", weights, samples.equations)
    count = float(len(samples))
    if sample_weights is not None:
        sample_weights = _weights("sample_weights", sample_weights, len(samples))
        count = float(sample_weights.sum())
    compiled = lib.compiled_statistics
    join: Callable[[Array], Array] = compiled.join if compiled else joined

    def block(start: int) -> Array:
        part = slice(start, start + BLOCK)
        s, own = samples.rows(part), None if sample_weights is None else sample_weights[part]
        # The C evaluates Y_b itself and knows columns of one joint each.
        if compiled is None or s.coupling is not None or s.base is not None:
            return reference_triangle(lib, s, weights, own)
        return compiled.triangle(s.q, s.dq, s.ddq, s.tau, s.columns, weights, own)

    starts = range(0, max(len(samples), 1), BLOCK)
    workers = min(len(starts), threads or cores())
    if workers > 1:
        with ThreadPoolExecutor(workers) as pool:
            triangles = list(pool.map(block, starts))
    else:
        triangles = [block(start) for start in starts]
    triangle = triangles[0] if len(triangles) == 1 else join(np.stack(triangles))
    if not np.isfinite(triangle).all():
        raise IdentificationError(
            "the samples hold NaN, infinite or absurdly large values; drop those rows before "
            "compressing them"
        )
    return from_triangle(triangle, count, lib.base_matrix, lib.manifest.model_hash)


def compress_all(lib: Library, pieces: Iterable[Samples], weights: Array) -> Statistics:
    """Statistics of all pieces together, few of whose factors are held at a time.

    Raises:
        IdentificationError: as `compress`, or there is no piece.
    """
    held: list[Statistics] = []
    for piece in pieces:
        held.append(compress(lib, piece, weights))
        if len(held) == TOGETHER:
            held = [held[0].merged(*held[1:])]
    if not held:
        raise IdentificationError("there are no samples to compress; use another --split")
    return held[0].merged(*held[1:]) if len(held) > 1 else held[0]


def reference_triangle(
    lib: Library, samples: Samples, weights: Array, sample_weights: Array | None
) -> Array:
    """The triangle of samples by NumPy, from explicit rows [F Y_b τ]: the C is held against it."""
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
    weights = np.ascontiguousarray(values, dtype=float)
    if weights.shape != (size,) or not (np.isfinite(weights) & (weights >= 0)).all():
        raise IdentificationError(
            f"expected {name} of shape ({size},), finite and at least 0, got shape "
            f"{weights.shape}; 1 counts every row alike"
        )
    return weights
