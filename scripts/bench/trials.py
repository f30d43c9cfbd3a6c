"""The document's Monte Carlo (Sec. 5.1): noisy torque, perturbed first guess, many trials."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.common.threads import cores
from runtime.estimators.classical.pc_ols import cone_optimum
from runtime.estimators.convex import CAD, convex_problem, follow_many, prior_of, reduce, solve_many
from runtime.estimators.regression import compress
from runtime.estimators.regression.samples import samples_of
from runtime.excitation import Trajectory
from runtime.experiments.trials.motions import document_robot
from runtime.identification import metrics
from runtime.library import Library
from runtime.simulation import Plant, ideal

Array = NDArray[np.float64]

NOISE, PERTURBED = 0.05, 0.15
"""Standard deviation of the torque, N·m, and of the first guess relative to the truth."""


@dataclass(frozen=True, slots=True)
class Trials:
    """Means over trials, and properties that hold in all of them."""

    airm: float  # mean distance of mass matrices over 50 configurations of the test trajectory
    percent: Array  # torque error per joint on it, %
    strict: float  # share of trials with P ≻ 0 for every link
    gap: float  # largest relative distance between path and Clarabel; NaN where it is not computed


def trajectories(path: Path, lib: Library) -> list[Trajectory]:
    """The designs of a file, best first."""
    facts = json.loads(path.read_text(encoding="utf-8"))
    return [
        Trajectory(lib.home, np.array(entry["coefficients"]), facts["duration"])
        for entry in facts["trajectories"]
    ]


def map_trials(
    lib: Library, train: Trajectory, test: Trajectory, count: int, certify: int = 0
) -> Trials:
    """`count` trials of MAP with weights 1/σ²; the first `certify` also of PC-OLS.

    The C solves all trials in one call.
    """
    pi = document_robot(lib)
    lam, plant = lib.lam_from_pi(pi), Plant(pi, torque_noise=NOISE)
    problems, data, priors, statistics = [], [], [], []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        samples = samples_of(ideal(lib, train, plant, rng=rng), lib)
        compressed = compress(lib, samples, np.full(lib.n_joints, NOISE**-2))
        start = lam * (1 + PERTURBED * rng.normal(size=lam.size))
        reduced, prior = reduce(compressed, lib.n_joints)[0], prior_of(lib, lib.pi_from_lam(start))
        gamma = CAD * reduced.variance / reduced.count
        problems.append(convex_problem(reduced, prior, gamma))
        data.append(reduced)
        priors.append(prior)
        statistics.append(compressed)
    estimates = solve_many(lib, problems, threads=cores())
    paths = follow_many(lib, data[:certify], priors[:certify], cores())
    gaps = [
        abs(path.losses[-1] / cone_optimum(lib, s).loss - 1)
        for path, s in zip(paths, statistics, strict=False)
    ]
    held = samples_of(ideal(lib, test, Plant(pi)), lib)
    rows = np.linspace(0, len(held) - 1, 50).round().astype(int)
    truth = lib.mass_matrix(held.q[rows], pi)
    airm, percent = [], []
    for one in estimates:
        airm.append(metrics.airm(truth, lib.mass_matrix(held.q[rows], one.pi)).mean())
        predicted = lib.inverse_dynamics(held.q, held.dq, held.ddq, one.pi)
        percent.append(metrics.torque_error(held.tau, predicted).percent)
    strict = [float(lib.relative_eigenvalues(one.pi).min()) > 0 for one in estimates]
    return Trials(
        float(np.mean(airm)),
        np.mean(percent, axis=0),
        float(np.mean(strict)),
        max(gaps, default=np.nan),
    )
