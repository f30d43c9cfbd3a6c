"""Contradictions between data, prior and result, in sentences that say which of them is wrong.

At most one of the answers is a doubt; a URDF that is off is none, because the result follows the
data. The test of an inertial prior, and the links whose prior the data contradict:

    T = min over π of ‖A π − b‖² / S + 2 κ Σ_k [tr(P0_k⁻¹ P_k) − log det P_k − 4 + log det P0_k]

is χ² distributed with rank A degrees of freedom where the prior and the noise S are right, because
b − A π0 then has the covariance S + A (κ B)⁻¹ Aᵀ. The prior of one link at a time is released,
which leaves its ten parameters to the data and to physical consistency. T then falls by a χ² of
ten degrees of freedom where the prior of that link is right, which is the sharper test of a single
wrong body, and shows which. It needs no margin: robots that are 25 % off their URDF, the size of
the prior, reach 0.98 of the quantile, the log of Franka's arm 0.6, an unknown body of 0.5 kg 1.7
and more in 96 of 100 logs.

Friction that the columns of a fit do not describe, a Stribeck peak and friction that grows with the
load, by the score test of columns Z that a linear fit lacks:

    τ = Y_b β + F φ + Z ζ + e,     Z_j = s(dq_j) [exp(−(dq_j / v)²), |τ̂_j|],     T = ‖P_Z r‖² / S

r is the residual of the fit without Z, and P_Z projects on what Z adds to the other columns. T is
χ² with rank P_Z degrees of freedom where ζ = 0, for noise of density S at the frequencies of the
columns. Every Z that is a function of the motion gives a valid test.
Source: Box 1980 for the prior predictive test, Breusch & Pagan 1980 for score tests; the release of
single links is this project's.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.special import chdtri

from runtime.common.tables import significant
from runtime.estimators.column_faults import column_faults
from runtime.estimators.convex.entropic_prior import Prior
from runtime.estimators.convex.newton import convex_problem, solve
from runtime.estimators.regression.causes import (
    DELAY,
    GAIN,
    OFFSET,
    SIGNIFICANCE,
    TILT,
    ZERO,
    Cause,
    Causes,
    causes_of,
)
from runtime.estimators.regression.coloured_noise import coloured_noise_of_shares
from runtime.estimators.regression.factor import Reduced
from runtime.estimators.regression.model_error import FreeFit
from runtime.estimators.regression.posterior import APART, ROUNDING, orthonormal
from runtime.library import Array, Library
from runtime.library.manifest import torque_units
from runtime.library.parameters import N_PARAMETERS, links, mass

MARGIN = 1.6
"""Factor on the quantile for errors of the model: real arms have friction that no column has. With
the arm of Franka, whose identified model predicts unseen torques to 1.4 %, T of the prior is 1.3 to
1.5 times the quantile; an unknown body of 0.5 kg in its hand gives 1.7 times and more."""
PEAK, SIGN = 0.15, 0.05  # speed v of the peak, width of the sign s, over a joint's RMS speed
RELEASED = (1e-1, 1e-2, 1e-3, 1e-4)
"""Factors on κ of a released link, each solved from the one before. With the last the logarithm
costs less than 0.1 per factor of ten in the volume of the body, and moves T by less than one."""
NEXT = 0.5
"""Part of the largest decrease of T from which another link is named, too: neighbouring links share
base parameters, so a body on one looks much like a body on the other."""
EXPLAINS = 0.3  # part of the excess of T that one link must explain for single links to be named
OTHER = 0.35
"""Share of the torque of links that a prior misses from which on it is of another robot: 0.03 to
0.13 for the URDFs of real logs, 0.26 for a tool of 1.5 kg that one of them lacks."""
ALIKE = 0.7  # correlation below which no factor explains a torque by that of a prior
LEAST_DENSITY = 1e-4
"""Smallest S: data that are exact to rounding are compared as if their noise were one percent of
the weighted unit, as in the maximum a posteriori."""


@dataclass(frozen=True, slots=True)
class PriorTest:
    """Result of the test."""

    statistic: float  # T
    threshold: float  # value that T of a right prior seldom exceeds
    decrease: float  # largest decrease of T by the release of one link; 0 below T's threshold
    link_threshold: float  # value that it seldom exceeds where the prior of every link is right
    # names of the links whose release explains the contradiction, the likeliest first; empty
    # without contradiction, or where no single link explains it
    links: tuple[str, ...]
    masses: tuple[tuple[float, float, float], ...]  # of these: prior, released, σ of the latter, kg
    scale: float  # least-squares factor between the measured torque and that of the prior
    likeness: float  # their correlation: 1 where the factor explains all of the measured torque
    # share of the torque of free bodies that the prior misses, friction being free,
    # (‖r_prior‖² − ‖r_free‖²)^½ / (‖r_0‖² − ‖r_free‖²)^½, r_0 without any body
    mismatch: float

    @property
    def is_contradicted(self) -> bool:
        """Whether the data contradict the prior."""
        return self.excess > 1

    @property
    def excess(self) -> float:
        """The larger of both statistics over its threshold."""
        return max(self.statistic / self.threshold, self.decrease / self.link_threshold)


def prior_test(
    lib: Library, data: Reduced, prior: Prior, kappa: float, density: float
) -> PriorTest:
    """Test a prior against data."""
    level = max(density, LEAST_DENSITY)
    gamma = kappa * level / data.count
    sizes = np.linalg.svd(data.factor, compute_uv=False)
    rank = int(np.sum(sizes > ROUNDING * sizes.max(initial=0.0)))
    threshold = MARGIN * float(chdtri(max(rank, 1), SIGNIFICANCE))
    single = float(chdtri(N_PARAMETERS, SIGNIFICANCE / lib.n_joints))

    def cost(pi: Array, counted: Array) -> float:
        """T at π, with the priors of the counted links (n,) only."""
        # A released body may lie on the boundary to rounding, where its logarithm is infinite.
        known = np.where(np.repeat(counted > 0, N_PARAMETERS), pi, prior.centre)
        return _misfit(data, pi) / level + 2 * kappa * float(_divergence(prior, known).sum())

    everyone = np.ones(lib.n_links)
    pi = solve(lib, convex_problem(data, prior, gamma)).pi
    statistic = cost(pi, everyone)
    # Torque of the prior against the measured one: a wrong unit or sign is one factor for all rows.
    expected = data.factor @ prior.centre
    scale = float(expected @ data.target) / max(float(expected @ expected), 1e-300)
    size = max(float(data.target @ data.target), 1e-300)
    likeness = abs(scale) * float(np.linalg.norm(expected)) / float(np.sqrt(size))
    missed = float(np.sqrt(_misfit(data, prior.centre) / size))
    if statistic <= min(threshold, single):  # no release can lower T by more
        return PriorTest(statistic, threshold, 0.0, single, (), (), scale, likeness, missed)
    decrease, released, ends = np.zeros(lib.n_links), np.zeros(lib.n_links), []
    for k in range(lib.n_links):
        counted = everyone - np.eye(lib.n_links)[k]
        moved = pi
        for factor in RELEASED:
            trust = gamma * np.where(counted > 0, 1.0, factor)
            minimum = solve(lib, convex_problem(data, prior, trust), moved)
            if not minimum.converged:
                break
            moved = minimum.pi
        decrease[k] = max(statistic - cost(moved, counted), 0.0)
        released[k] = mass(links(moved))[k]
        ends.append(minimum)
    named = [int(k) for k in np.argsort(-decrease) if decrease[k] > NEXT * decrease.max()]
    if decrease.max() < EXPLAINS * (statistic - threshold):
        named = []
    centres = mass(links(prior.centre))

    def sigma(k: int) -> float:
        """σ of the released mass: the cost is T S / 2 N, so that the covariance is S/N H⁻¹."""
        inverse = np.linalg.pinv(ends[k].hessian(), hermitian=True)
        return float(np.sqrt(level / data.count * inverse[N_PARAMETERS * k, N_PARAMETERS * k]))

    names = tuple(lib.link_names[k] for k in named)
    masses = tuple((float(centres[k]), float(released[k]), sigma(k)) for k in named)
    most = float(decrease.max())
    return PriorTest(statistic, threshold, most, single, names, masses, scale, likeness, missed)


def _misfit(data: Reduced, pi: Array) -> float:
    """‖A π − b‖², what a model leaves beyond the free least squares."""
    rest = data.factor @ pi - data.target
    return float(rest @ rest)


def _divergence(prior: Prior, pi: Array) -> Array:
    """tr(P0_k⁻¹ P_k) − log det P_k − 4 + log det P0_k of every link, (n,), at least 0."""
    now, then = prior.bodies.log_det(pi), prior.bodies.log_det(prior.centre)
    if now is None or then is None:
        return np.full(len(links(pi)), np.inf)
    traces = (prior.slope * pi).reshape(-1, N_PARAMETERS).sum(axis=1)
    return np.asarray(traces - 4.0 - now + then)


@dataclass(frozen=True, slots=True, eq=False)
class ScoreTest:
    """Result of the test of columns Z."""

    statistic: float  # T
    quantile: float  # value that T exceeds with the probability `SIGNIFICANCE` where ζ = 0
    density: float  # S, in units of the weights
    columns: Array  # what Z adds to the other columns, (N n, k)


def score_test(fit: FreeFit, columns: Array) -> ScoreTest | None:
    """Test columns that a fit lacks."""
    added = columns - fit.basis @ (fit.basis.T @ columns)
    directions = orthonormal(added, APART, np.linalg.norm(columns, axis=0), least=1.0)
    if not directions.shape[1]:
        return None
    explained = directions.T @ fit.rest
    shape = (len(fit.samples), fit.scale.size)
    left = (fit.rest - directions @ explained).reshape(shape)
    unknowns = fit.basis.shape[1] + directions.shape[1]
    density = coloured_noise_of_shares(fit.shares_with(directions), left, unknowns).density
    if not density > 0:
        return None
    quantile = float(chdtri(directions.shape[1], SIGNIFICANCE))
    return ScoreTest(float(explained @ explained) / density, quantile, density, added)


@dataclass(frozen=True, slots=True, eq=False)
class FrictionTest:
    """Result of the test."""

    excess: float  # statistic of all joints over the value that it seldom exceeds
    joints: Array  # excess of the columns of each joint alone, (n,); 0 where `excess` ≤ 1

    @property
    def is_contradicted(self) -> bool:
        """Whether the residuals contain friction that no column describes."""
        return self.excess > 1

    def names(self, lib: Library) -> list[str]:
        """Joints whose own columns are contradicted, or the one with the largest excess."""
        largest = float(self.joints.max())
        chosen = np.flatnonzero(self.joints >= min(1.0, largest))
        return [lib.joint_names[int(k)] for k in chosen]


def friction_test(fit: FreeFit) -> FrictionTest | None:
    """Test the friction columns of a fit."""
    columns, moving = friction_columns(fit)
    test = score_test(fit, columns)
    if test is None:
        return None
    joints = np.zeros(fit.scale.size)
    excess = test.statistic / test.quantile
    for k, joint in enumerate(moving if excess > 1 else ()):
        added = orthonormal(test.columns[:, 2 * k : 2 * k + 2], APART)
        explained = added.T @ fit.rest
        quantile = float(chdtri(max(added.shape[1], 1), SIGNIFICANCE))
        joints[joint] = float(explained @ explained) / test.density / quantile
    return FrictionTest(excess, joints)


def friction_columns(fit: FreeFit) -> tuple[Array, list[int]]:
    """The two columns of every joint that moves."""
    dq, n = fit.samples.dq, fit.scale.size
    speed = np.sqrt(np.mean(dq**2, axis=0))
    moving = speed > 0
    unit = np.where(moving, speed, 1.0)
    sign = np.tanh(dq / (SIGN * unit))
    load = np.abs(fit.predicted.reshape(-1, n))
    columns = np.zeros((len(dq), n, n, 2))
    columns[:, range(n), range(n), 0] = sign * np.exp(-((dq / (PEAK * unit)) ** 2))
    columns[:, range(n), range(n), 1] = sign * load
    return columns[:, :, moving].reshape(len(dq) * n, -1), [int(k) for k in np.flatnonzero(moving)]


SCALE = 3.0
"""Factor between measured torque and that of the URDF beyond which the unit of the torque is the
likeliest fault: a load of twice the own weight of an arm stays below it."""
VISIBLE = 0.10  # deviation of a torque gain that a log should show; joints above it are named
LARGEST = np.radians(10.0)  # limit of an encoder zero or tilt from which a log is said to hide it
CERTAIN = 3.0  # change of the mass of a released link over its σ from which on it is stated
FOLLOWS = "; the result follows the data"  # end of a sentence on a wrong URDF or prior
UNFITTED = 2.0
"""Misfit of a result over the threshold of the test of the prior above which the method, and not
the prior, is the cause."""


@dataclass(frozen=True, slots=True, eq=False)
class ModelTests:
    """Results of all tests."""

    contradictions: tuple[str, ...] = ()  # sentence that doubts the result; empty if none
    model_errors: tuple[str, ...] = ()  # what the data contradict while the result holds
    limits: tuple[str, ...] = ()  # sentences on gains, encoder zeros, tilts that leave no trace
    causes: Causes = field(default_factory=Causes)  # compared; none where they were not tested


def model_tests(
    lib: Library,
    fit: FreeFit | None,
    data: Reduced,
    prior: Prior,
    kappa: float,
    density: float,
    pi: Array,
    *,
    delay: Callable[[], tuple[float, float] | None] | None = None,
) -> ModelTests:
    """Test data, prior and result against each other.

    delay: δ and its σ [s] by the profile of the log, None where the log does not determine them;
    it is asked for where a delay is named.
    """
    causes = Causes() if fit is None else causes_of(lib, fit, pi)
    if delay is not None and any(each.kind == DELAY for each in causes.named):
        estimate = delay()
        causes = causes if estimate is None else causes.with_delay(*estimate)
    friction = None if fit is None else friction_test(fit)
    test = prior_test(lib, data, prior, kappa, density)
    misfit = _misfit(data, pi) / max(density, LEAST_DENSITY) / test.threshold
    named = tuple(sorted(causes.named, key=lambda cause: not cause.is_plausible))
    # Placeholders for links without <inertial> are no prior that a torque could contradict.
    contradicted = test.is_contradicted and (prior.is_of_type or not lib.placeholders)
    doubt, errors = "", []
    source = "the prior of the fleet" if prior.is_of_type else "the URDF"
    if contradicted or not all(each.is_plausible for each in named):
        doubt = _of_columns(lib, fit)
    if not doubt and contradicted and not 1 / SCALE < test.scale < SCALE:
        doubt = _of_unit(test, source)
    if named and named[0].is_usable:
        errors.append(
            f"{sentence_of(lib, named)}: the parameters take up a part of it, and their intervals "
            f"are too narrow; {remedy_of(lib, named[0])}"
        )
    elif named:
        doubt = doubt or _of_cause(lib, named)
    if contradicted and not doubt:
        if test.mismatch >= OTHER and not test.links:
            doubt = _of_prior(test, source)
        else:
            errors.insert(0, _of_urdf(test, source, prior.is_of_type))
    if friction is not None and friction.is_contradicted:
        errors.append(
            f"the residuals of {', '.join(friction.names(lib))} contain friction that the columns "
            "do not describe, a Stribeck peak or friction that grows with the load "
            f"({friction.excess:.2g} times the threshold): the parameters take up a part of it, "
            "and their intervals are too narrow; compare with --friction auto (where "
            "that was given, no column describes this friction)"
        )
    if not (doubt or test.is_contradicted) and misfit > UNFITTED:
        doubt = (
            f"the result leaves {misfit:.2g} times as much of the training torque unexplained as "
            "its noise and the prior allow, so the method stopped short of the data; use map"
        )
    return ModelTests((doubt,) if doubt else (), tuple(errors), _of_limits(lib, causes), causes)


def sentence_of(lib: Library, named: tuple[Cause, ...]) -> str:
    """The cause in words, and those that explain nearly as much."""
    others = " or ".join(_words(lib, each) for each in named[1:] if each.is_plausible)
    beside = f" ({others} explains nearly as much)" if others else ""
    of = "the torques of the joints contradict each other, mostly by"
    if named[0].kind != GAIN:
        of = "the residuals are those of"
    return f"{of} {_words(lib, named[0])}{beside}"


def _words(lib: Library, cause: Cause) -> str:
    name = lib.joint_names[cause.joint]
    unit, size = torque_units(lib.manifest)[cause.joint], cause.size
    angle, scale = ("mm", 1e3) if unit == "N" else ("°", 180 / np.pi)
    side = "late" if size > 0 else "early"
    late = f"{1e3 * abs(size):.1f} ± {1e3 * cause.sigma:.2g} ms too {side} for the motion"
    if not cause.is_measured:
        late = f"too {side} for the motion"
    return {
        GAIN: f"a torque gain of {1 + size:.3f} ± {cause.sigma:.1g} at {name}, relative to the "
        "other joints",
        DELAY: f"a torque that is stamped {late}",
        ZERO: f"an encoder of {name} that reads {scale * size:.2g} ± {scale * cause.sigma:.1g} "
        f"{angle} too much",
        TILT: f"a base that is tilted by {np.degrees(size):.2g} ± {np.degrees(cause.sigma):.1g}°",
        OFFSET: f"a constant torque of {size:.2g} ± {cause.sigma:.1g} {unit} at {name}",
    }[cause.kind]


def remedy_of(lib: Library, cause: Cause) -> str:
    """What to do about a cause."""
    name = lib.joint_names[cause.joint]
    if cause.kind == TILT:
        gravity = ",".join(f"{x:.3f}" for x in lib.gravity + cause.vector)
        return f"measure its angles, or build the robot with --gravity={gravity}"
    return {
        GAIN: f"check the torque constant of {name}, or estimate the gains of all joints by "
        "python -m runtime gains; of a commanded torque check the gains of its law",
        DELAY: "correct it with --delay auto, or where that was given with another friction model, "
        "which may look like a delay",
        ZERO: f"calibrate the zero of {name}, or estimate it by identify --settings "
        "encoder_bias=true",
        OFFSET: "add offset to the columns of --friction",
    }[cause.kind]


def _of_columns(lib: Library, fit: FreeFit | None) -> str:
    """Sentence on signs and orders of columns, compared as `inspect` does; "" where they hold."""
    if fit is None or fit.samples.acceleration is None or fit.samples.equations != lib.n_joints:
        return ""
    named = column_faults(lib, fit.samples).named
    if not named:
        return ""
    return (
        f"{' and '.join(fault.sentence(lib.joint_names) for fault in named)}, and no torque gain "
        "explains it: the log is wrong rather than the URDF; inspect proposes a recipe that "
        "corrects it"
    )


def _of_cause(lib: Library, named: tuple[Cause, ...]) -> str:
    """Sentence on a cause without which the result predicts other torques."""
    best = named[0]
    if not best.is_plausible:
        name = lib.joint_names[best.joint]
        return (
            f"the torques of the joints contradict each other, most at {name}, and no torque gain "
            "explains it: the torque is wrong rather than the URDF; check order and sign of the "
            f"signals and the friction of {name} with: python -m runtime inspect LOG"
        )
    wrong = {GAIN: "torque", DELAY: "clock of the torque", ZERO: "position"}.get(best.kind, "mount")
    return (
        f"{sentence_of(lib, named)}: the {wrong} is wrong rather than the URDF; "
        f"{remedy_of(lib, best)}"
    )


def _of_limits(lib: Library, causes: Causes) -> tuple[str, ...]:
    """Sentence on gains, encoder zeros and tilts that may be wrong without a trace."""
    said, hidden = [], []
    for name, limit in zip(lib.joint_names, causes.limits(GAIN), strict=False):
        if limit > VISIBLE:
            size = f"up to {100 * limit:.2g} %" if limit < 1 else "of any size"
            hidden.append(f"{name} ({size})")
    if hidden:
        said.append(
            f"this log may not show a wrong torque gain of {', '.join(hidden)}, because friction "
            "and inertia take it up; python -m runtime gains determines it"
        )
    turns = [unit != "N" for unit in torque_units(lib.manifest)]
    zeros = [*zip(lib.joint_names, causes.limits(ZERO), turns, strict=False)]
    tilts = [np.degrees(x) for x in causes.limits(TILT) if x < LARGEST]
    parts = [f"a tilt of the base from {x:.2g}°" for x in tilts]
    shown = [f"of {name} from {np.degrees(x):.2g}°" for name, x, on in zeros if on and x < LARGEST]
    if shown:
        parts.append(f"a wrong encoder zero {', '.join(shown)}")
    if parts:
        rest = sum(turn for *_, turn in zeros) - len(shown)
        others = f", and that of {rest} other joints at no angle below {np.degrees(LARGEST):.0f}°"
        said.append(f"this log shows {' and '.join(parts)} on{others if shown and rest else ''}")
    return tuple(said)


def _of_unit(test: PriorTest, source: str) -> str:
    if test.likeness < ALIKE:
        return (
            f"the measured torque does not follow that of {source} (correlation "
            f"{test.likeness:.2g}): joints in another order, a torque without the controller's "
            "gravity compensation, or another robot; check it with: python -m runtime inspect LOG"
        )
    return (
        f"the measured torque is {test.scale:.3g} times that of {source}: the unit or sign of the "
        f"torque is wrong rather than {source}; state them in a recipe: torque in N·m, or "
        "currents in A with the torque constants of the manufacturer"
    )


def _is_certain(before: float, after: float, sigma: float) -> bool:
    """Whether the data determine a mass; near the base a release leaves it to the logarithm."""
    return abs(after - before) > CERTAIN * sigma


def _bodies(test: PriorTest, source: str) -> str:
    """Links whose release explains the contradiction, with the masses that the data determine."""
    listed = []
    for name, (before, after, sigma) in zip(test.links, test.masses, strict=True):
        both = f" ({before:.3g} kg in {source}, {after:.3g} ± {2 * sigma:.1g} kg from the data)"
        listed.append(name + both if _is_certain(before, after, sigma) else name)
    return " or ".join(listed)


def _of_urdf(test: PriorTest, source: str, is_of_type: bool) -> str:
    """Sentence on a prior that is off, while the result follows the data."""
    size = f"{test.excess:.2g} times the threshold"
    missed = f"{significant(100 * test.mismatch)} % of the torque of its links"
    if not test.links:
        return (
            f"{source} is off by {missed}: the data contradict its inertias ({size}), while the "
            f"joints agree with each other{FOLLOWS}"
        )
    wrong = (
        "this unit differs from its fleet, or carries a load that the others did not; leave out "
        "--prior, or add its statistics to the fleet"
        if is_of_type
        else "the URDF is wrong rather than the log, or the arm carries a load that it does not "
        "contain"
    )
    before, after, sigma = test.masses[0]
    if _is_certain(before, after, sigma):
        missed = f"{missed}, {after - before:+.2g} kg at {test.links[0]}"
    return (
        f"{source} is off by {missed}: the data contradict the inertia of "
        f"{_bodies(test, source)}, or of what it carries ({size}), while the joints agree with "
        f"each other: {wrong}{FOLLOWS}"
    )


def _of_prior(test: PriorTest, source: str) -> str:
    """Sentence on a prior that is further off than that of the same robot, in no single link."""
    return (
        f"the data contradict the inertias of {source} ({test.excess:.2g} times the threshold), "
        f"and no single link explains it: {source} is of another robot, or order, unit or sign of "
        "the signals are wrong; check them with: python -m runtime inspect LOG"
    )
