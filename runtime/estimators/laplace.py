"""Laplace's approximation of the posterior of π: its covariance and the shares of data and prior.

    C = (N H / S)⁻¹ = (AᵀA / S + κ B)⁻¹,  B = ∇² Σ_k [tr(P0_k⁻¹ P_k) − log det P_k]

with A of weighted, friction-eliminated data and S, their noise at the frequencies of the motion
(`coloured_noise`). C lives in π, not in λ, where the delta method is undefined at a = b or c = 0.
`estimate_error` adds what an estimate differs from the centre of C.
Source: Bayes' rule by Laplace's approximation (MacKay 2003, Ch. 27).
"""

from collections.abc import Callable

import numpy as np

from runtime.estimators.contradictions import ModelTests, model_tests
from runtime.estimators.convex import CAD, bodies_of, reduce, spread_of
from runtime.estimators.estimate_error import vague_posterior
from runtime.estimators.regression import Statistics, compress
from runtime.estimators.regression.coloured_noise import ColouredNoise, coloured_noise_of
from runtime.estimators.regression.residuals import noise, residuals, weights_from
from runtime.estimators.regression.samples import Samples
from runtime.estimators.regression.score_test import free_fit
from runtime.estimators.type_prior import prior_about
from runtime.estimators.uncertainty import Information, Uncertainty, white_share
from runtime.estimators.verdicts import beta_verdicts, verdict
from runtime.library import Array, Library


def uncertainty_of(
    lib: Library,
    samples: Samples,
    pi: Array,
    phi: Array,
    *,
    first_guess: Array,
    kappa: float = CAD,
    statistics: Statistics | None = None,
    coloured_noise: ColouredNoise | None = None,
    compressed: Callable[[Array], Statistics] | None = None,
    is_most_probable: bool = True,
    centre: Array | None = None,
    tests: bool = True,
) -> Uncertainty:
    """Uncertainty of an identified model, by any method."""
    rest = residuals(lib, samples, pi, phi)
    coloured = coloured_noise
    if statistics is None or coloured is None:
        weights = weights_from(noise(rest, lib, phi.size), samples.tau)
        statistics = compressed(weights) if compressed else compress(lib, samples, weights)
        coloured = coloured_noise_of(lib, [samples], statistics, weights)
    # C = (AᵀA/S + κ B)⁻¹: A of weighted data with friction eliminated, B of the prior.
    data, _ = reduce(statistics, samples.equations)
    bodies, prior = bodies_of(lib), prior_about(lib, first_guess, centre)
    inside = bodies.log_det(pi) is not None
    level = max(coloured.density, np.finfo(float).tiny)
    rows, target = data.factor / np.sqrt(level), data.target / np.sqrt(level)
    spread = spread_of(bodies, pi if inside else prior.centre, rows, kappa)
    # What the estimate differs from data with hardly any prior counts as its error, unless the
    # trust in the prior was estimated from other units of the type.
    reference, vague = vague_posterior(lib, prior, rows, target)
    if centre is not None:
        reference = pi
    root = np.column_stack([spread.root if is_most_probable else vague, pi - reference])
    outcome = ModelTests()
    if tests:
        fit = free_fit(lib, samples, weights_from(noise(rest, lib, phi.size), samples.tau))
        outcome = model_tests(
            lib, fit, data, prior, kappa, level, pi, is_of_type=centre is not None
        )
    # Rank of the motion: singular values of A over columns of unit length in the statistics.
    base = lib.base_matrix
    silent = np.logical_not(base.any(axis=0)).tolist()
    lengths = np.linalg.norm(statistics.factor, axis=0)
    excited = np.linalg.svd(
        data.factor[:, list(lib.base_columns)] / np.where(lengths > 0, lengths, 1.0)[: len(base)],
        compute_uv=False,
    )
    # A rotor column that a link's inertia explains: their sum is excited, so it counts.
    shared = int(np.sum(statistics.explained() & (lengths[len(base) :] > 0)))
    known = int(np.sum(excited > 1e-9 * excited[:1]))  # the largest is first
    rank = min(known + shared, len(base))
    return Uncertainty(
        root=root,
        share=spread.share,
        verdicts=tuple(verdict(q, float(s)) for q, s in zip(silent, spread.share, strict=True)),
        beta_sigma=np.linalg.norm(base @ root, axis=1),
        beta_verdicts=beta_verdicts(base, spread, vague),
        noise=noise(rest, lib, phi.size, coloured.inflation),
        n_samples=round(statistics.n_samples),
        n_eff=statistics.n_samples / coloured.inflation,
        inflation=coloured.inflation,
        white=white_share(rest),
        rank=rank,
        determined=spread.determined,
        conditioning=float(excited[rank - 1] / excited[0]) if rank else 0.0,
        information=Information(statistics, float(level), kappa, prior.centre),
        tests=outcome,
    )
