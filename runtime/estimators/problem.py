"""`Problem` and `Fit`: the input and the result of every estimator, and bounds of its friction.

Steps in λ, thresholds of the loss and the noise of the document's weights are those of arms of a
few kg per link, in kg, m and N·m. Other arms have another unit s of mass: τ and F φ are linear in
masses, so that the problem has τ/s, φ/s and π/s, and a loss L/s². s is a power of four, which makes
the conversion exact, and 1 for usual arms.

Bounds of friction coefficients, which least squares respects by an active set:

    lower ≤ φ ≤ upper,   |φ_jk| rms C_jk ≤ MOST rms τ_j,   φ_jk ≥ 0 for viscous, Coulomb, rotor, …

`within_bounds` solves without bounds first. Coefficients beyond a bound are held there, those whose
multiplier has the wrong sign are released, and the problem is solved again; at the end the
Karush–Kuhn–Tucker conditions hold. Source: Portugal, Júdice & Vicente 1994 (block pivoting).
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import IdentificationError
from runtime.estimators.optimizers import Trace
from runtime.estimators.regression.coloured_noise import ColouredNoise
from runtime.estimators.regression.factor import Statistics, compress_all
from runtime.estimators.regression.posterior import posterior_of
from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library, Mask
from runtime.library.parameters import lam_from_parts, lam_parts, links, mass
from runtime.recording import Friction, Recording
from runtime.recording.settings import names_where

USUAL = 2.0  # median mass of a link of usual arms, kg
WITHIN = 16.0  # factor on it within which the unit stays 1 kg
MOST = 10.0
"""Largest torque of one friction column, RMS over that of the joint: columns that cancel each other
may exceed the torque, but ten times is beyond what a motion can determine."""
ROUNDS = 20  # limit of the number of solutions; two or three are usual
BLOCKED = 5  # solutions after which one coefficient at a time is exchanged, which cannot cycle
MULTIPLIER = 1e-9  # multiplier, relative to column times torque, below which it counts as zero

NEGATIVE = 0.01
"""Torque of a negative coefficient relative to that of the joint above which its cause is stated;
below it is within the errors of friction models."""
EVIDENCE = 0.05
"""Evidence for a coefficient above which its cause is stated. 1000 rows of 7 joints, a tenth of
them effective, determine a coefficient to 0.04; correct simulated logs reach 0.017, those with a
reversed joint at least 0.1."""
TINY = 1e-300  # smallest divisor: an exact fit has no residual
NEGATIVE_CAUSE = (
    "a joint is not driven by its friction or its rotor: a velocity or torque is reversed, joints "
    "are exchanged, a gear ratio is missing, or the friction falls with speed; check the log with "
    "symgen inspect"
)

ERROR_OF = "error of "  # before the name of a sensor whose error is a column
OF = " of "  # between the name of a column and that of its joint

Answer = TypeVar("Answer")


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


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """Bounds of φ."""

    lower: Array  # (n k,) [N·m per unit of the column]
    upper: Array  # (n k,)


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """Coefficients that ended at a bound."""

    flags: Mask  # which, (n k,)
    free: Array  # φ of the solution without bounds, (n k,)
    phi: Array  # φ within the bounds, (n k,)
    # |φ| of the solution without bounds times the length of the part of its column that no other
    # column produces, relative to the residual of that solution; (n k,)
    evidence: Array


def bounds_of(problem: Problem, is_passive: bool) -> Bounds:
    """Bounds of the friction coefficients of a problem."""
    train = problem.train
    columns = train.column_sizes()
    torque = np.sqrt(np.mean(np.square(train.tau), axis=0))
    # A motor drives several joints, and rows of power belong to no joint.
    shared = train.coupling is not None or train.equations < len(columns)
    size = np.full(len(columns), np.linalg.norm(torque)) if shared else torque
    none, most = np.zeros_like(columns), MOST * size[:, None]
    upper = np.divide(most, columns, out=none, where=columns > 0).ravel()
    lower = -upper
    if is_passive:
        lower = np.where(_nonnegative(problem.friction_names, train.shape), 0.0, lower)
    return Bounds(lower, upper)


def within_bounds(
    statistics: Statistics,
    bounds: Bounds,
    solve: Callable[[Statistics], tuple[Array, Array, Answer]],
) -> tuple[Array, Answer, Held]:
    """Solve a least-squares problem with φ within bounds: solve (n k,) → (n k,)."""
    lower, upper = bounds.lower, bounds.upper
    columns = statistics.factor[:, statistics.n_base :]
    lengths = np.linalg.norm(columns, axis=0)
    torque = np.sqrt(statistics.target @ statistics.target + statistics.rest)
    tolerance = MULTIPLIER * lengths * torque
    phi, beta, answer = solve(statistics)
    first = np.concatenate([beta, phi])
    free, side = phi, np.zeros(lengths.size, dtype=int)  # −1 at the lower bound, 1 at the upper
    for k in range(ROUNDS):
        residual = statistics.factor @ np.concatenate([beta, phi]) - statistics.target
        slope = columns.T @ residual
        # Held at the lower bound the loss must rise with φ, at the upper one with −φ.
        wrong = np.where(side != 0, side * slope > tolerance, False)
        below = (side == 0) & (phi < lower) & (lengths > 0)
        above = (side == 0) & (phi > upper) & (lengths > 0)
        exchange = wrong | below | above
        if not exchange.any():
            break
        if k >= BLOCKED:
            exchange &= np.arange(exchange.size) == np.flatnonzero(exchange)[-1]
        side = np.where(exchange, np.where(wrong, 0, np.where(below, -1, 1)), side)
        held = side != 0
        values = np.where(side < 0, lower, upper)
        phi, beta, answer = solve(statistics.holding(held, values) if held.any() else statistics)
        phi = np.where(held, values, phi)
    # The limit of rounds is a safeguard against rounding: the answer is kept within the bounds.
    held = side != 0
    phi = np.clip(phi, lower, upper)
    return phi, answer, Held(held, free, phi, _evidence(statistics, first, held))


def notes_of(
    held: Held, bounds: Bounds, joints: Sequence[str], names: Sequence[str]
) -> tuple[str, ...]:
    """Sentences on coefficients that ended at a bound."""
    if not held.flags.any():
        return ()
    names = names or [f"column {k + 1}" for k in range(len(held.phi) // len(joints))]
    at = [f"{name}{OF}{joint}" for joint in joints for name in names]
    if len(names) == len(held.phi) and all(OF in name for name in names):  # of one joint each
        at = list(names)
    # The upper bound is where the torque is `MOST` times that of the joint. Columns that almost
    # cancel each other have large coefficients of both signs, for which there is no evidence.
    share = MOST * np.abs(held.free) / np.where(bounds.upper > 0, bounds.upper, 1.0)
    is_zero = held.flags & (held.phi == 0)

    def listed(flags: Mask) -> str:
        return ", ".join(f"{at[i]} ({held.free[i]:.3g} unbounded)" for i in np.flatnonzero(flags))

    is_large = (share > NEGATIVE) & (held.evidence > EVIDENCE)
    small, large = is_zero & ~is_large, is_zero & is_large
    limit = held.flags & ~is_zero
    notes = []
    if large.any():
        notes.append(f"negative coefficients were bounded by 0: {listed(large)}; {NEGATIVE_CAUSE}")
    if small.any():
        notes.append(
            f"coefficients near 0, or hardly determined, were bounded by 0: {listed(small)}"
        )
    if limit.any():
        notes.append(
            f"the motion does not determine the friction columns {listed(limit)}; they were held "
            f"where their torque is {MOST:g} times that of the joint; leave them out"
        )
    return tuple(notes)


def negative_share(columns: Array, tau: Array, phi: Array, names: Sequence[str]) -> Array:
    """Torque (n, k) of negative coefficients that should be ≥ 0, relative to the joint's."""
    shape = columns.shape[1:]
    size = np.sqrt(np.mean(np.square(columns), axis=0)) * np.abs(phi)
    torque = np.sqrt(np.mean(np.square(tau), axis=0))
    share = np.divide(size, torque[:, None], out=np.zeros(shape), where=torque[:, None] > 0)
    return np.where((phi < 0) & _nonnegative(names, shape).reshape(shape), share, 0.0)


def _evidence(statistics: Statistics, first: Array, held: Mask) -> Array:
    """Residual that each held column alone removes, relative to that of the solution `first`."""
    if not held.any():
        return np.zeros(held.size)
    residual = statistics.factor @ first - statistics.target
    size = np.sqrt(residual @ residual + statistics.rest)
    # A column has the length 1/σ apart from all others; it is 0 where they explain it.
    apart = np.nan_to_num(1 / posterior_of(statistics.factor).sigma[statistics.n_base :])
    evidence = np.abs(first[statistics.n_base :]) * apart / max(float(size), TINY)
    return np.where(held, evidence, 0.0)


def _nonnegative(names: Sequence[str], shape: tuple[int, ...]) -> Mask:
    """Flag of every coefficient that cannot be negative, (n k,)."""
    known = names_where(lambda column: column.is_nonnegative)
    flags = [name.split(OF)[0] in known for name in names] or [False] * shape[1]
    return np.tile(flags, shape[0])
