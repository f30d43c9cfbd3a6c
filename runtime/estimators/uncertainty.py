"""How sure an answer is: covariance in π, what the data say and what the prior says, torque bands.

    C = (N H / S)⁻¹ = (AᵀA / S + κ B)⁻¹,  B = ∇² Σ_k [tr(P0_k⁻¹ P_k) − log det P_k]

with A of weighted, friction-eliminated data and S, their noise at the frequencies of the motion
(`coloured_noise`). C lives in π, not in λ, where the delta method is undefined at a = b or c = 0.
Source: Bayes' rule by Laplace's approximation (MacKay 2003, Ch. 27).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from runtime.estimators.convex import CAD, bodies_of, com_sigma, prior_of, reduce, spread_of
from runtime.estimators.convex.posterior_spread import DETERMINED
from runtime.estimators.regression import Statistics, compress
from runtime.estimators.regression.coloured_noise import Colour, colour_of
from runtime.estimators.regression.residuals import (
    LAGS,
    autocorrelation,
    noise,
    residuals,
    weights_from,
)
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

IDENTIFIED, PRIOR_DOMINATED, UNOBSERVABLE = "identified", "prior-dominated", "unobservable"
WHITE = 1.96
"""Half width of the 95 % band of a white residual's autocorrelation, in units of 1/√N."""
BAND_SAMPLES = 200
"""Samples whose bands are summed up for a report."""


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """What vouches for the numbers.

    Attributes:
        root: C = root rootᵀ of π, (10 n, 10 n).
        share: posterior over prior variance of every entry of π, (10 n,), in (0, 1].
        verdicts: per entry of π: identified, prior-dominated or unobservable.
        beta_sigma: standard deviation of the base parameters, (n_b,).
        noise: s_j, residual RMS per joint, (n,), N·m or N.
        n_samples, n_eff: training samples, and what they are worth.
        inflation: N / N_eff, 1 for white noise.
        white: share of lags, per joint, whose autocorrelation a white residual could have, (n,).
        rank: directions of β that the motion excites, of n_b.
        told: directions of π of which the data say ten times more than the prior, at most n_b.
        conditioning: weakest over strongest excited direction.
    """

    root: Array
    share: Array
    verdicts: tuple[str, ...]
    beta_sigma: Array
    noise: Array
    n_samples: int
    n_eff: float
    inflation: float
    white: Array
    rank: int
    told: int
    conditioning: float

    def __repr__(self) -> str:
        return f"Uncertainty({self.advice()})"

    @property
    def covariance(self) -> Array:
        """C of π, (10 n, 10 n)."""
        return self.root @ self.root.T

    @property
    def sigma(self) -> Array:
        """Standard deviation of every entry of π, (10 n,)."""
        return np.asarray(np.linalg.norm(self.root, axis=1))

    def com_sigma(self, pi: Array) -> list[Array | None]:
        """Standard deviation of every link's centre of mass c = (m c)/m, (3,) m; None without m."""
        return com_sigma(self.root, pi)

    def torque_band(self, lib: Library, q: Array, dq: Array, ddq: Array) -> Array:
        """One standard deviation of a measured torque, √(diag(Y C Yᵀ) + s²), (N, n)."""
        return np.sqrt(self.model_band(lib, q, dq, ddq) ** 2 + self.noise**2)

    def model_band(self, lib: Library, q: Array, dq: Array, ddq: Array) -> Array:
        """One standard deviation of the model's own torque, √diag(Y C Yᵀ), (N, n)."""
        y = lib.regressor(*(np.atleast_2d(a) for a in (q, dq, ddq)))
        return np.asarray(np.linalg.norm(y @ self.root, axis=2))

    def band_of(self, lib: Library, samples: Samples) -> Array:
        """The same of rows, √diag(Y_b K C Kᵀ Y_bᵀ), (N, m)."""
        spread = samples.base_rows(lib) @ (lib.base_matrix @ self.root)
        return np.asarray(np.linalg.norm(spread, axis=2))

    def with_noise(self, rest: Array, lib: Library) -> "Uncertainty":
        """The same with noise and whiteness of other residuals (N, n), all unknowns known."""
        return replace(self, noise=noise(rest, lib, 0), white=_white(rest))

    def advice(self) -> str:
        """One sentence: what to trust, and what to record next."""
        count = len(self.beta_sigma)
        if self.rank < count:
            return (
                f"the motion excites {self.rank} of {count} base parameters; the others are those "
                "of the first guess, so record a motion that moves every joint (excite designs one)"
            )
        if self.inflation > 2:
            return (
                f"neighbouring residuals are alike, so {self.n_samples} samples are worth "
                f"{self.n_eff:.0f}: friction, filter or clock leave a pattern; a better friction "
                "model will help more than more samples"
            )
        return (
            f"residuals look independent and all {count} base parameters are excited: torques "
            "of similar motions can be trusted within their bands"
        )


def uncertainty_of(
    lib: Library,
    samples: Samples,
    pi: Array,
    phi: Array,
    *,
    first_guess: Array,
    kappa: float = CAD,
    statistics: Statistics | None = None,
    colour: Colour | None = None,
    compressed: Callable[[Array], Statistics] | None = None,
) -> Uncertainty:
    """The uncertainty around an answer of any method.

    Args:
        lib: of the robot.
        samples: training samples.
        pi: answer, (10 n,); where it is no body that exists strictly, the prior's curvature is
            taken at the first guess.
        phi: friction coefficients.
        first_guess: π that the prior is around.
        kappa: trust in it.
        statistics: of the samples with weights 1/s_j², if they are there already.
        colour: of their noise, likewise.
        compressed: weights → statistics of all samples, where `samples` are only some of them.
    """
    rest = residuals(lib, samples, pi, phi)
    if statistics is None or colour is None:
        weights = weights_from(noise(rest, lib, phi.size), samples.tau)
        statistics = compressed(weights) if compressed else compress(lib, samples, weights)
        colour = colour_of(lib, [samples], statistics, weights)
    data, _ = reduce(statistics, samples.equations)
    bodies, prior = bodies_of(lib), prior_of(lib, first_guess)
    inside = bodies.log_det(pi) is not None
    level = max(colour.level, np.finfo(float).tiny)
    spread = spread_of(bodies, pi if inside else prior.centre, data.factor / np.sqrt(level), kappa)
    base = lib.base_matrix
    silent = np.logical_not(base.any(axis=0)).tolist()
    lengths = np.linalg.norm(statistics.factor, axis=0)
    excited = np.linalg.svd(
        data.factor[:, list(lib.base_columns)] / np.where(lengths > 0, lengths, 1.0)[: len(base)],
        compute_uv=False,
    )
    # A rotor that does what a link's inertia does leaves their sum known.
    shared = int(np.sum(statistics.explained() & (lengths[len(base) :] > 0)))
    known = int(np.sum(excited > 1e-9 * max(float(excited.max(initial=0.0)), 1e-300)))
    rank = min(known + shared, len(base))
    return Uncertainty(
        root=spread.root,
        share=spread.share,
        verdicts=tuple(_verdict(q, float(s)) for q, s in zip(silent, spread.share, strict=True)),
        beta_sigma=np.linalg.norm(base @ spread.root, axis=1),
        noise=noise(rest, lib, phi.size, colour.inflation),
        n_samples=round(statistics.n_samples),
        n_eff=statistics.n_samples / colour.inflation,
        inflation=colour.inflation,
        white=_white(rest),
        rank=rank,
        told=spread.told,
        conditioning=float(excited[rank - 1] / excited[0]) if rank else 0.0,
    )


def _verdict(silent: bool, share: float) -> str:
    if silent:
        return UNOBSERVABLE
    return IDENTIFIED if share < DETERMINED else PRIOR_DOMINATED


def _white(rest: Array) -> Array:
    inside = np.abs(autocorrelation(rest)) < WHITE / np.sqrt(len(rest))
    return np.asarray(inside.sum(axis=0) / LAGS)
