"""Test of an inertial prior against the data, and the links whose prior the data contradict.

    T = min over π of ‖A π − b‖² / S + 2 κ Σ_k [tr(P0_k⁻¹ P_k) − log det P_k − 4 + log det P0_k]

is χ² distributed with rank A degrees of freedom where the prior and the noise S are right, because
b − A π0 then has the covariance S + A (κ B)⁻¹ Aᵀ. The prior of one link at a time is released,
which leaves its ten parameters to the data and to physical consistency. T then falls by a χ² of
ten degrees of freedom where the prior of that link is right, which is the sharper test of a single
wrong body, and shows which. It needs no margin: robots that are 25 % off their URDF, the size of
the prior, reach 0.98 of the quantile, the log of Franka's arm 0.6, an unknown body of 0.5 kg 1.7
and more in 96 of 100 logs.
Source: Box 1980 for the prior predictive test; the release of single links is this project's.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from runtime.estimators.convex.compiled import solve
from runtime.estimators.convex.eliminate_friction import Reduced
from runtime.estimators.convex.entropic_prior import Prior
from runtime.estimators.convex.newton import convex_problem
from runtime.estimators.regression.omitted_columns import MARGIN, SIGNIFICANCE
from runtime.estimators.regression.posterior import ROUNDING
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, links, mass

RELEASED = (1e-1, 1e-2, 1e-3, 1e-4)
"""Factors on κ of a released link, each solved from the one before. With the last the logarithm
costs less than 0.1 per factor of ten in the volume of the body, and moves T by less than one."""
NEXT = 0.5
"""Part of the largest decrease of T from which another link is named, too: neighbouring links share
base parameters, so a body on one looks much like a body on the other."""
EXPLAINS = 0.3
"""Part of the excess of T that one link must explain for single links to be named."""
OTHER = 0.35
"""Share of the torque of links that a prior misses from which on it is of another robot: 0.03 to
0.13 for the URDFs of real logs, 0.26 for a tool of 1.5 kg that one of them lacks."""
LEAST_DENSITY = 1e-4
"""Smallest S: data that are exact to rounding are compared as if their noise were one percent of
the weighted unit, as in the maximum a posteriori."""


@dataclass(frozen=True, slots=True)
class PriorTest:
    """Result of the test."""

    statistic: float  # T
    threshold: float  # value that T of a right prior seldom exceeds
    # largest decrease of T by the release of one link; 0 where T itself is smaller than its
    # threshold
    decrease: float
    link_threshold: float  # value that it seldom exceeds where the prior of every link is right
    # names of the links whose release explains the contradiction, the likeliest first; empty
    # without contradiction, or where no single link explains it
    links: tuple[str, ...]
    # masses of these links in the prior, with the prior released, and σ of the latter, kg
    masses: tuple[tuple[float, float, float], ...]
    scale: float  # least-squares factor between the measured torque and that of the prior
    # share of the torque of free bodies that the prior misses, friction being free,
    # (‖r_prior‖² − ‖r_free‖²)^½ / (‖r_0‖² − ‖r_free‖²)^½, r_0 without any body
    mismatch: float

    @property
    def is_of_another(self) -> bool:
        """Whether the prior is of another robot, or the arm carries much."""
        return self.mismatch >= OTHER

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
    missed = float(np.sqrt(_misfit(data, prior.centre) / size))
    if statistic <= min(threshold, single):  # no release can lower T by more
        return PriorTest(statistic, threshold, 0.0, single, (), (), scale, missed)
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

    return PriorTest(
        statistic,
        threshold,
        float(decrease.max()),
        single,
        tuple(lib.link_names[k] for k in named),
        tuple((float(centres[k]), float(released[k]), sigma(k)) for k in named),
        scale,
        missed,
    )


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
