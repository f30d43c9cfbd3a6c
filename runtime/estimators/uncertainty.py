"""Uncertainty of an identified model: covariance of π, shares of data and prior, torque bands.

`laplace` computes it.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from runtime.estimators.contradictions import ModelTests
from runtime.estimators.convex import com_sigma
from runtime.estimators.regression import Statistics
from runtime.estimators.regression.residuals import LAGS, NORMAL_95, autocorrelation, noise
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library

BAND_SAMPLES = 200
"""Samples whose bands a report summarises."""


@dataclass(frozen=True, slots=True, eq=False)
class Information:
    """Data and prior of a posterior, exp(−‖R [K π; φ] − r‖²/2S − κ Σ_k [tr(P0⁻¹P) − log det P]).

    Attributes:
        statistics: R and r of all training samples, weighted.
        density: S, variance with which the noise enters the unknowns.
        kappa: κ, trust in the centre of the prior.
        centre: π0 of the prior, (10 n,).
    """

    statistics: Statistics
    density: float
    kappa: float
    centre: Array


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """Covariance of π and the figures that a report states beside it.

    Attributes:
        root: C = root rootᵀ of π, (10 n, 10 n + 1); the last column is the error of the estimate.
        share: posterior over prior variance of every entry of π, (10 n,), in (0, 1].
        verdicts: per entry of π: identified, prior-dominated or unobservable.
        beta_sigma: standard deviation of the base parameters, (n_b,).
        beta_verdicts: per base parameter: identified where the data reduce its prior variance at
            least tenfold and bring half of its precision without the prior, else
            prior-dominated.
        noise: s_j, residual RMS per joint, (n,), N·m or N.
        n_samples, n_eff: number of training samples, and effective sample size.
        inflation: N / N_eff, 1 for white noise.
        white: share of lags, per joint, whose autocorrelation a white residual could have, (n,).
        rank: number of directions of β that the motion excites, of n_b.
        determined: number of directions of π in which the data carry ten times the information
            of the prior, at most n_b.
        conditioning: weakest over strongest excited direction.
        information: what the posterior is computed from; None where it was not kept.
        tests: what the data contradict, and what they cannot show.
        filtered: N / N_eff that the low-pass filter leaves of white noise, 1 without a filter.
    """

    root: Array
    share: Array
    verdicts: tuple[str, ...]
    beta_sigma: Array
    beta_verdicts: tuple[str, ...]
    noise: Array
    n_samples: int
    n_eff: float
    inflation: float
    white: Array
    rank: int
    determined: int
    conditioning: float
    information: Information | None = None
    tests: ModelTests = field(default_factory=ModelTests)
    filtered: float = 1.0

    def __repr__(self) -> str:
        return f"Uncertainty({self.advice()})"

    @property
    def contradictions(self) -> tuple[str, ...]:
        """Sentences on priors, joints and results that the data contradict."""
        return self.tests.contradictions

    @property
    def model_errors(self) -> tuple[str, ...]:
        """Sentences on assumptions of the intervals that the residuals contradict."""
        return self.tests.model_errors

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
        """Standard deviation of a measured torque, √(diag(Y C Yᵀ) + s²).

        q (N, n) [rad, m] → (N, n) [N·m, N].
        """
        return np.sqrt(self.model_band(lib, q, dq, ddq) ** 2 + self.noise**2)

    def model_band(self, lib: Library, q: Array, dq: Array, ddq: Array) -> Array:
        """Standard deviation of the predicted torque, √diag(Y C Yᵀ), without measurement noise.

        q (N, n) [rad, m] → (N, n) [N·m, N].
        """
        y = lib.regressor(*(np.atleast_2d(a) for a in (q, dq, ddq)))
        return np.asarray(np.linalg.norm(y @ self.root, axis=2))

    def band_of(self, lib: Library, samples: Samples) -> Array:
        """Standard deviation of the predicted torque of prepared rows, √diag(Y_b K C Kᵀ Y_bᵀ).

        Returns (N, m) [N·m, N; W for rows of power].
        """
        spread = samples.base_rows(lib) @ (lib.base_matrix @ self.root)
        return np.asarray(np.linalg.norm(spread, axis=2))

    def with_noise(self, rest: Array, lib: Library) -> "Uncertainty":
        """The same with the noise and the autocorrelation of other residuals.

        rest (N, n) [N·m, N].
        """
        return replace(self, noise=noise(rest, lib, 0), white=white_share(rest))

    def advice(self) -> str:
        """What to trust, what this log cannot show, and what to record next."""
        if self.contradictions:
            doubts = "; ".join((*self.contradictions, *self.model_errors))
            return f"do not trust the result or its intervals yet: {doubts}"
        if self.model_errors:  # gains that a better model shows are no limit of the log
            return self._trust()
        return "; ".join((self._trust(), *self.tests.limits))

    def _trust(self) -> str:
        """Sentence on the reliability of a result without contradictions."""
        count = len(self.beta_sigma)
        if self.rank < count:
            return (
                f"the motion excites {self.rank} of {count} base parameters; the others keep the "
                "values of the first guess; record a motion that moves every joint (the command "
                "excite designs one)"
            )
        if self.model_errors:
            return "; ".join(self.model_errors)
        if self.inflation > 2 * self.filtered:
            return (
                f"the residuals are autocorrelated: the effective sample size of {self.n_samples} "
                f"samples is {self.n_eff:.0f}; friction or the clock leave a pattern, "
                "whose bias of the parameters the intervals cannot contain, and a better friction "
                "model helps more than more samples"
            )
        look = "look independent"
        if self.filtered > 1:
            look += f" beyond the low-pass filter ({self.n_eff:.0f} independent samples)"
        return (
            f"the residuals {look} and the motion excites all {count} base parameters: "
            "predicted torques of similar motions hold within their bands"
        )


def white_share(rest: Array) -> Array:
    """Share of lags, per joint, whose autocorrelation white residuals (N, n) could have, (n,)."""
    inside = np.abs(autocorrelation(rest)) < NORMAL_95 / np.sqrt(len(rest))
    return np.asarray(inside.sum(axis=0) / LAGS)
