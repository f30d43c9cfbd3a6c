"""`Problem` and `Fit`: the input and the result of every estimator.

Steps in λ, thresholds of the loss and the noise of the document's weights are those of arms of a
few kg per link, in kg, m and N·m. Other arms have another unit s of mass: τ and F φ are linear in
masses, so that the problem has τ/s, φ/s and π/s, and a loss L/s². s is a power of four, which makes
the conversion exact, and 1 for usual arms.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import IdentificationError
from runtime.estimators.optimizers import Trace
from runtime.estimators.regression.coloured_noise import ColouredNoise
from runtime.estimators.regression.factor import Statistics, compress_all
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library, Mask
from runtime.library.parameters import lam_from_parts, lam_parts, links, mass
from runtime.recording import Friction, Recording

USUAL = 2.0  # median mass of a link of usual arms, kg
WITHIN = 16.0  # factor on it within which the unit stays 1 kg


@dataclass(frozen=True, slots=True)
class Origin:
    """Log behind the samples, for methods that simulate or filter."""

    recording: Recording  # the training recording before it was prepared and split
    friction: Friction  # names and width of the friction columns
    aligned: Callable[[Recording], Samples]  # recording of the same clock → its training rows
    span: tuple[float, float]  # first and last instant of the training samples, s
    inputs: Mapping[str, Any] = field(default_factory=dict)  # what single methods need, by name


@dataclass(frozen=True, slots=True, eq=False)
class FrictionPrior:
    """Gaussian prior of friction coefficients."""

    mean: Array  # (n, k) [N·m per unit of the column]
    sigma: Array  # standard deviations, (n, k); infinite where there is no prior

    @classmethod
    def of_some(
        cls, shape: tuple[int, ...], places: Any, mean: ArrayLike, sigma: ArrayLike
    ) -> "FrictionPrior":
        """Prior of the coefficients at some places, and none of the others."""
        prior = cls(np.zeros(shape), np.full(shape, np.inf))
        prior.mean[places], prior.sigma[places] = mean, sigma
        return prior

    def over(self, other: "FrictionPrior") -> "FrictionPrior":
        """This prior, and another one where it states none."""
        known = np.isfinite(self.sigma)
        mean = np.where(known, self.mean, other.mean)
        return FrictionPrior(mean, np.where(known, self.sigma, other.sigma))

    def statistics(self, like: Statistics, variance: float) -> Statistics:
        """The prior as rows of least squares."""
        rows, target = np.zeros_like(like.factor), np.zeros_like(like.target)
        root = np.sqrt(variance) / self.sigma.ravel()
        places = np.arange(like.n_base, len(target))
        rows[places, places] = root
        target[places] = root * self.mean.ravel()
        return replace(like, factor=rows, target=target, rest=0.0, n_samples=0.0)


@dataclass(frozen=True, slots=True, eq=False)
class NoiseFloor:
    """Least noise of rows whose residuals cannot show it: fewer independent ones than unknowns."""

    sigma: Array  # least standard deviation per equation, (m,) [N·m, N]
    inflation: float  # least N / N_eff


@dataclass(frozen=True, eq=False)  # no slots: the statistics are computed once and kept
class Problem:
    """Data, weights and first guess of an identification, the same for every method."""

    lib: Library  # library of the robot
    train: Samples  # samples to fit
    validation: Samples  # samples for early stopping
    weights: Array  # diagonal of W, (n,) [1/(N·m)²]
    start: Array  # λ of the first guess, (10 n,)
    seed: int = 0  # seed of the mini-batches
    progress: Callable[[int, float], None] | None = None  # gets iteration, best validation loss
    # all samples of "train" or "validation", piece by piece, where `train` and `validation` hold
    # only some of them
    pieces: Callable[[str], Iterable[Samples]] | None = None
    terms: Friction | None = None  # friction columns
    # names of the k columns of the samples; those of several logs have an offset column per log
    # beyond `terms`
    column_names: tuple[str, ...] = ()
    left_out: Mask | None = None
    friction_prior: FrictionPrior | None = None  # of φ, for map
    noise_floor: NoiseFloor | None = None  # of the rows, for map; None: by the residuals

    def statistics(self, weights: Array | None = None) -> Statistics:
        """Compressed training samples, with the weights of the problem unless others are given."""
        return self._weighted if weights is None else self._compressed(weights)

    @cached_property
    def _weighted(self) -> Statistics:
        return self._compressed(self.weights)

    def _compressed(self, weights: Array) -> Statistics:
        return compress_all(self.lib, self.samples("train"), weights)

    def samples(self, part: str) -> Iterable[Samples]:
        """All samples of a part, "train" or "validation", a piece at a time."""
        if self.pieces is not None:
            return self.pieces(part)
        return (self.train if part == "train" else self.validation,)

    @property
    def friction_names(self) -> tuple[str, ...]:
        """Names of the friction columns; empty where they are unknown."""
        return self.column_names or (self.terms.columns if self.terms else ())


class Learned(Protocol):
    """Friction torque beyond φ that a method learned."""

    def __call__(self, columns: Array) -> Array:
        """Torque (N, n) [N·m, N] from friction columns (N, n, k)."""

    def facts(self) -> dict[str, Any]:
        """What a result file holds, JSON-ready; `Method.learned` reads it."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Result of an estimator."""

    pi: Array  # π, (10 n,) [kg, kg·m, kg·m²]
    phi: Array  # friction coefficients (n, k), k = 0 without friction
    lam: Array | None  # λ, (10 n,); None where a link is not physically consistent
    status: str  # how the estimator ended, one sentence
    iterations: int | None = None  # number of steps; None for closed forms
    trace: Trace | None = None  # losses on the way, where the method records them
    optimum: float | None = None  # smallest loss of any consistent model, if the method has it
    notes: tuple[str, ...] = ()  # further sentences on how the result came about
    weights: Array | None = None  # diagonal of W, where the method has estimated it, (n,)
    statistics: Statistics | None = None  # of the training samples with these weights
    coloured_noise: ColouredNoise | None = None  # with these weights, where it is estimated
    learned: Learned | None = None  # friction beyond φ, where the method learned one
    # smallest relative eigenvalue of the links before thin axes were raised; None where the method
    # raises none
    unrepaired: float | None = None

    def noise(self) -> tuple[Array, ColouredNoise]:
        """Diagonal of W (n,) and noise of the weighted rows, of a method that estimates both."""
        if self.weights is None or self.coloured_noise is None:
            raise IdentificationError(
                f"expected an estimate of the noise, got none ({self.status}); use the method map"
            )
        return self.weights, self.coloured_noise

    @property
    def n_eff(self) -> float | None:
        """Effective sample size, where the coloured noise is known."""
        if self.statistics is None or self.coloured_noise is None:
            return None
        return self.statistics.n_samples / self.coloured_noise.inflation


def best_friction(statistics: Statistics, pi: Array, shape: tuple[int, ...]) -> Array:
    """Friction coefficients (n, k) that fit best at fixed π, by least squares."""
    columns = statistics.factor[:, statistics.n_base :]
    rest = -statistics.residual(pi, np.zeros(columns.shape[1]))
    return np.asarray(np.linalg.lstsq(columns, rest, rcond=None)[0], dtype=float).reshape(shape)


def mass_unit(lib: Library, pi: Array) -> float:
    """Unit of mass s of a robot, kg: pi (10 n,) [kg, kg·m, kg·m²]."""
    middle = float(np.median(mass(links(pi))))
    if not middle > 0:
        middle = float(np.median(mass(links(lib.pi0))))
    if not 0 < middle < np.inf or USUAL / WITHIN <= middle <= USUAL * WITHIN:
        return 1.0
    return float(4.0 ** round(np.log(middle / USUAL) / np.log(4.0)))


def in_unit(problem: Problem, unit: float) -> Problem:
    """The same problem with another unit of mass."""
    if unit == 1.0:
        return problem
    pieces = problem.pieces

    def scaled(samples: Samples) -> Samples:
        return replace(samples, tau=samples.tau / unit)

    # λ of π/s: ln m − ln s, and semi-axes over √s; c and ω stay.
    log, root = np.log(unit), np.sqrt(unit)
    parts = map(lam_parts, links(problem.start))
    bodies = [lam_from_parts(m - log, c, omega, axes / root) for m, c, omega, axes in parts]
    return replace(
        problem,
        train=scaled(problem.train),
        validation=scaled(problem.validation),
        start=np.concatenate(bodies),
        pieces=None if pieces is None else lambda part: map(scaled, problem.samples(part)),
    )
