"""Uncertainty of an identified model: covariance of π, shares of data and prior, torque bands.

Laplace's approximation of the posterior of π (MacKay 2003, Ch. 27):

    C = (N H / S)⁻¹ = (AᵀA / S + κ B)⁻¹,  B = ∇² Σ_k [tr(P0_k⁻¹ P_k) − log det P_k]

with A of weighted, friction-eliminated data and S, their noise at the frequencies of the motion
(`coloured_noise`). C lives in π, not in λ, where the delta method is undefined at a = b or c = 0.

An estimate has an error beyond C, which is computed from data with hardly any prior:

    π_v, C_v:  mean and covariance of ‖A π − b‖² / S + ‖π − π0‖²_B,   B at round bodies

A Gaussian prior of unknown quality, 100 % of every direction of bodies as large as those of the
URDF but round, moves only what the data leave undetermined. It has no boundary, and it does not
confine a link that is thin in the URDF. With d = π̂ − π_v an estimate π̂ has the mean squared error
C + d dᵀ. C is the posterior covariance for the most probable model, and C_v for other methods.
Source: Hausman 1978 for the comparison of an efficient estimator with one that holds under weaker
assumptions.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import gamma

import numpy as np

from runtime.common.records import Positive
from runtime.estimators.contradictions import ModelTests, model_tests
from runtime.estimators.convex.entropic_prior import (
    CAD,
    NONE,
    Prior,
    bodies_of,
    com_sigma,
    prior_about,
    spread_of,
)
from runtime.estimators.regression.coloured_noise import ColouredNoise, coloured_noise_of
from runtime.estimators.regression.factor import Reduced, Statistics, compress, reduce
from runtime.estimators.regression.model_error import free_fit, model_error_of
from runtime.estimators.regression.posterior import DETERMINED, Posterior, posterior_of
from runtime.estimators.regression.samples import (
    LAGS,
    NORMAL_95,
    Samples,
    autocorrelation,
    noise,
    residuals,
    weights_from,
)
from runtime.library import Array, Library
from runtime.recording import Preparation

ROUND = 1 / 3  # smallest eigenvalue of Σ_com over their sum of a round body
IDENTIFIED, PRIOR_DOMINATED, UNOBSERVABLE = "identified", "prior-dominated", "unobservable"
ALONE = 0.5
"""Share of the posterior precision of a base parameter that the data bring without the prior, below
which the prior decides: its interval holds more often than its level states, up to 100 %."""
BAND_SAMPLES = 200  # samples whose bands a report summarises


@dataclass(frozen=True, slots=True, eq=False)
class LogInformation:
    """Data and prior of a posterior, exp(−‖R [K π; φ] − r‖²/2S − κ Σ_k [tr(P0⁻¹P) − log det P])."""

    statistics: Statistics  # R and r of all training samples over their noise and model error
    density: Positive  # S, variance with which the noise enters the unknowns
    kappa: Positive  # κ, trust in the centre of the prior
    centre: Array  # π0 of the prior, (10 n,)


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """Covariance of π and the figures that a report states beside it."""

    # C = root rootᵀ of π, (10 n, 10 n + m + 1); behind the first 10 n columns m of nuisance torque,
    # the last of them of torque gains, and the error of the estimate
    root: Array
    share: Array  # posterior over prior variance of every entry of π, (10 n,), in (0, 1]
    verdicts: tuple[str, ...]  # per entry of π: identified, prior-dominated or unobservable
    beta_sigma: Array  # standard deviation of the base parameters, (n_b,)
    # per base parameter: identified where the data reduce its prior variance at least tenfold and
    # bring half of its precision without the prior, else prior-dominated
    beta_verdicts: tuple[str, ...]
    noise: Array  # s_j, residual RMS per joint, (n,), N·m or N
    n_samples: int  # n_samples, n_eff: number of training samples, and effective sample size
    n_eff: float
    inflation: float  # N / N_eff, 1 for white noise
    white: Array  # share of lags, per joint, with an autocorrelation of white noise, (n,)
    rank: int  # number of directions of β that the motion excites, of n_b
    # number of directions of π in which the data carry ten times the information of the prior, at
    # most n_b
    determined: int
    conditioning: float  # weakest over strongest excited direction
    information: LogInformation | None = None  # source of the posterior; None if not kept
    tests: ModelTests = field(default_factory=ModelTests)  # contradictions, and what is not shown
    filtered: float = 1.0  # N / N_eff that the low-pass filter leaves of white noise, else 1
    # what the m columns of nuisance torque move φ at known π, (n k, m)
    phi_nuisance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    gain_sigma: float = 0.0  # relative σ of every torque gain that the root contains
    gains: int = 0  # number of their columns

    def __repr__(self) -> str:
        return f"Uncertainty({self.advice()})"

    @property
    def contradictions(self) -> tuple[str, ...]:
        """Sentence that doubts the result; empty where there is none."""
        return self.tests.contradictions

    @property
    def model_errors(self) -> tuple[str, ...]:
        """Sentences on what the data contradict while the result holds."""
        return self.tests.model_errors

    @property
    def covariance(self) -> Array:
        """C of π, (10 n, 10 n)."""
        return self.root @ self.root.T

    @property
    def sigma(self) -> Array:
        """Standard deviation of every entry of π, (10 n,)."""
        return np.asarray(np.linalg.norm(self.root, axis=1))

    @property
    def readings_root(self) -> Array:
        """Root of what errors of the readings of these sensors: that of π without their gains."""
        return without_gains(self.root, self.gains)

    def com_sigma(self, pi: Array) -> list[Array | None]:
        """Standard deviation of every link's centre of mass c = (m c)/m, (3,) m; None without m."""
        return com_sigma(self.root, pi)

    def torque_band(self, lib: Library, q: Array, dq: Array, ddq: Array) -> Array:
        """σ (N, n) of a measured torque, √(diag(Y C Yᵀ) + s²) [N·m, N]."""
        return np.sqrt(self.model_band(lib, q, dq, ddq) ** 2 + self.noise**2)

    def model_band(self, lib: Library, q: Array, dq: Array, ddq: Array) -> Array:
        """σ (N, n) of the predicted torque, √diag(Y C Yᵀ), without noise [N·m, N]."""
        y = lib.regressor(*(np.atleast_2d(a) for a in (q, dq, ddq)))
        return np.asarray(np.linalg.norm(y @ self.readings_root, axis=2))

    def band_of(self, lib: Library, samples: Samples) -> Array:
        """σ (N, m) of the predicted torque of prepared rows, √diag(Y_b K C Kᵀ Y_bᵀ)."""
        spread = samples.base_rows(lib) @ (lib.base_matrix @ self.readings_root)
        return np.asarray(np.linalg.norm(spread, axis=2))

    def with_noise(self, rest: Array, lib: Library) -> "Uncertainty":
        """The same with the noise and the autocorrelation of other residuals (N, n)."""
        return replace(self, noise=noise(rest, lib, 0), white=white_share(rest))

    def beside(self, lib: Library, moved: Array, phi: Array) -> "Uncertainty":
        """The same with what further unknowns move π, (10 n, m), and φ at known π, (n k, m)."""
        root = np.insert(self.root, [self.root.shape[0]], moved, axis=1)
        known = self.phi_nuisance if self.phi_nuisance.size else np.zeros((len(phi), 0))
        sigma, whole = np.linalg.norm(lib.base_matrix @ root, axis=1), np.hstack([phi, known])
        return replace(self, root=root, beta_sigma=sigma, phi_nuisance=whole)

    def advice(self) -> str:
        """Advice on the trust in the result, the limits of the log and the next recording."""
        if self.contradictions:
            return f"do not trust the result or its intervals yet: {self.contradictions[0]}"
        return "; ".join((self._trust(), *self.tests.limits))

    def first_advice(self) -> str:
        """The advice that matters most, where nothing contradicts the result."""
        is_short = self.rank < len(self.beta_sigma) or self.inflation > 2 * self.filtered
        return self._trust() if is_short or not self.tests.limits else self.tests.limits[0]

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
    gain_sigma: float = 0.0,
    delay: Callable[[], tuple[float, float] | None] | None = None,
) -> Uncertainty:
    """Uncertainty of an identified model, by any method.

    gain_sigma: expected relative σ of every torque gain. delay: as `model_tests` takes it.
    """
    rest = residuals(lib, samples, pi, phi)
    coloured = coloured_noise
    if statistics is None or coloured is None:
        _, statistics, coloured = visible_noise(lib, samples, pi, phi, compressed)
    # C = (AᵀA/S + κ B)⁻¹: A of weighted data with friction eliminated, B of the prior.
    fit = free_fit(lib, samples, weights_from(noise(rest, lib, phi.size), samples.tau))
    widened = model_error_of(lib, fit, pi, statistics, gain_sigma)
    data, _ = reduce(widened.statistics, samples.equations)
    prior = prior_about(lib, first_guess, centre)
    level = max(coloured.density, np.finfo(float).tiny)
    spread = laplace(
        *(lib, widened.statistics, data, level, pi, prior, kappa, widened.slopes),
        is_most_probable=is_most_probable,
    )
    outcome = ModelTests()
    if tests:
        outcome = model_tests(lib, fit, data, prior, kappa, level, pi, delay=delay)
    rank, weakest = excited_directions(lib, statistics, samples.equations)
    base = lib.base_matrix
    return Uncertainty(
        root=spread.root,
        share=spread.by_kappa.share,
        verdicts=spread.verdicts(base),
        beta_sigma=np.linalg.norm(base @ spread.root, axis=1),
        beta_verdicts=spread.beta_verdicts(base),
        noise=noise(rest, lib, phi.size, coloured.inflation),
        n_samples=round(statistics.n_samples),
        n_eff=statistics.n_samples / coloured.inflation,
        inflation=coloured.inflation,
        white=white_share(rest),
        rank=rank,
        determined=spread.by_kappa.determined,
        conditioning=weakest,
        information=LogInformation(widened.statistics, float(level), kappa, prior.centre),
        tests=outcome,
        phi_nuisance=spread.phi_nuisance,
        gain_sigma=widened.gain_sigma if widened.gains else 0.0,
        gains=widened.gains,
    )


def excited_directions(lib: Library, statistics: Statistics, equations: int) -> tuple[int, float]:
    """Number of directions of β that a motion excites, and the weakest over the strongest.

    By singular values of its rows without φ, over columns of unit length in the statistics.
    """
    base = len(lib.base_matrix)
    lengths = np.linalg.norm(statistics.factor, axis=0)
    over_base = reduce(statistics, equations)[0].factor[:, list(lib.base_columns)]
    excited = np.linalg.svd(
        over_base / np.where(lengths > 0, lengths, 1.0)[:base], compute_uv=False
    )
    # A rotor column that a link's inertia explains: their sum is excited, so it counts.
    shared = int(np.sum(statistics.explained() & (lengths[base:] > 0)))
    rank = min(int(np.sum(excited > 1e-9 * excited[:1])) + shared, base)  # the largest is first
    return rank, float(excited[rank - 1] / excited[0]) if rank else 0.0


def visible_noise(
    lib: Library,
    samples: Samples,
    pi: Array,
    phi: Array,
    compressed: Callable[[Array], Statistics] | None = None,
) -> tuple[Array, Statistics, ColouredNoise]:
    """Weights by the residuals of a model, statistics with them, and the noise of these rows."""
    rest = residuals(lib, samples, pi, phi)
    weights = weights_from(noise(rest, lib, phi.size), samples.tau)
    statistics = compressed(weights) if compressed else compress(lib, samples, weights)
    return weights, statistics, coloured_noise_of(lib, [samples], statistics, weights)


def filter_inflation(steps: Preparation, rate_hz: float) -> float:
    """N / N_eff of white noise after the low-pass filter of a prepared recording.

    A Butterworth filter of order N, forwards and backwards, has the power gain (1 + x^2N)⁻² at
    x = f/f_c and the noise bandwidth

        B = f_c ∫₀^∞ (1 + x^2N)⁻² dx = f_c Γ(1 + 1/2N) Γ(2 − 1/2N)

    so that white noise at the rate f_s after it has N/N_eff = f_s / 2B.
    Source: Bendat & Piersol 2010 for the noise bandwidth; the integral is a beta function.
    """
    if steps.filter != "butterworth" or not steps.cutoff_hz or steps.regressor != "acceleration":
        return 1.0
    half = 1 / (2 * steps.order)
    bandwidth = steps.cutoff_hz * gamma(1 + half) * gamma(2 - half)
    return max(1.0, rate_hz / (2 * bandwidth))


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Spread of π about an estimate."""

    root: Array  # of C, of m columns of nuisance torque, and the error of the estimate
    phi_nuisance: Array  # what the m columns move φ at known π, (n k, m)
    by_kappa: Posterior  # with the trust κ in the prior
    vague: Array  # root of C_v

    def verdicts(self, base: Array) -> tuple[str, ...]:
        """Verdicts on the entries of π, base K (n_b, 10 n)."""
        known = verdicts_of(self.by_kappa.share)
        return tuple(np.where(base.any(axis=0), known, UNOBSERVABLE).tolist())

    def beta_verdicts(self, base: Array) -> tuple[str, ...]:
        """Verdicts on the base parameters β = K π."""
        roots = self.by_kappa.root, self.vague
        tight, loose = (np.sum((base @ root) ** 2, axis=1) for root in roots)
        by_data = tight >= ALONE * loose
        shares = np.where(by_data, self.by_kappa.share_of(base), 1.0)  # 1 is that of the prior
        return tuple(verdicts_of(shares).tolist())


def laplace(
    lib: Library,
    statistics: Statistics,
    data: Reduced,
    level: float,
    pi: Array,
    prior: Prior,
    kappa: float,
    slopes: Array,
    *,
    is_most_probable: bool,
) -> Spread:
    """Laplace's approximation about π̂: data with friction eliminated, slopes of nuisance torque."""
    bodies = bodies_of(lib)
    inside = bodies.log_det(pi) is not None
    rows, target = data.factor / np.sqrt(level), data.target / np.sqrt(level)
    by_kappa = spread_of(bodies, pi if inside else prior.centre, rows, kappa)
    # What the estimate differs from data with hardly any prior counts as its error, unless the
    # trust in the prior was estimated from other units of the type.
    reference, vague = vague_posterior(lib, prior, rows, target)
    if prior.is_of_type:
        reference = pi
    usual = by_kappa.root if is_most_probable else vague
    # What nuisance torque of size 1 moves φ at known π, and π.
    n_base = statistics.n_base
    base, columns = statistics.factor[:, :n_base], statistics.factor[:, n_base:]
    friction = posterior_of(columns).root
    phi = friction @ (friction.T @ slopes[n_base:])
    left = lib.base_matrix.T @ (slopes[:n_base] - base.T @ (columns @ phi)) / level
    root = np.column_stack([usual, usual @ (usual.T @ left), pi - reference])
    return Spread(root, phi, by_kappa, vague)


def without_gains(root: Array, gains: int) -> Array:
    """A root without its columns of torque gains, which are before the last."""
    return np.delete(root, np.s_[-1 - gains : -1], axis=1)


def verdicts_of(share: Array) -> Array:
    """Verdicts on parameters from their posterior over prior variance."""
    return np.where(share < DETERMINED, IDENTIFIED, PRIOR_DOMINATED)


def vague_posterior(lib: Library, prior: Prior, rows: Array, target: Array) -> tuple[Array, Array]:
    """Mean and root of the covariance of π, by rows (m, 10 n), with a prior of unknown quality."""
    around = lib.nearest_realisable(prior.centre, ROUND)
    spread = spread_of(prior.bodies, around, rows, NONE, target - rows @ prior.centre)
    return prior.centre + spread.mean, spread.root
