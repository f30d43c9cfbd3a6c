"""Trials of the document's Monte Carlo (Sec. 5.1), of a weighed box, and of both regressors."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import signal

import runtime
from runtime import Recording, identify_payload
from runtime.common.threads import cores
from runtime.estimators.classical.pc_ols import cone_optimum, follow_compiled
from runtime.estimators.convex.entropic_prior import CAD, prior_of
from runtime.estimators.convex.newton import convex_problem, solve_many
from runtime.estimators.regression.factor import compress, reduce
from runtime.estimators.regression.samples import NORMAL_95, samples_of
from runtime.excitation import Trajectory
from runtime.experiments.trials import document_robot
from runtime.identification import metrics
from runtime.identification.payload.arm_error import arm_model
from runtime.identification.payload.body import mount_of, pi_of_body
from runtime.identification.single_log import identify_recording as fit
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation
from runtime.simulation import Plant, ideal
from runtime.simulation.virtual_robot import perturbed

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
    pairs = zip(data[:certify], priors[:certify], strict=True)
    paths = [follow_compiled(lib, each, prior) for each, prior in pairs]
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


COM = np.array([0.01, 0.02, 0.05])
SQUARES = np.array([0.1, 0.08, 0.06]) ** 2
TRUTH = np.array([1.0, *COM, *(SQUARES.sum() - SQUARES) / 12, 0.0, 0.0, 0.0])
"""A box of 1 kg and .1 × .08 × .06 m beside the flange: m, c, inertia about c."""


@dataclass(frozen=True, slots=True)
class Weighed:
    """RMS errors over trials, g and mm, and the coverage of the 95 % intervals."""

    grams: float
    millimetres: float
    coverage: float


def weigh(
    lib: Library, trajectory: Trajectory, count: int, cutoff: float | None, off: float = 0.0
) -> Weighed:
    """Identify a box from logs of 10 s at 100 Hz with white torque noise."""
    mount = mount_of(lib, lib.link_names[-1])
    body = pi_of_body(mount.bodies, TRUTH[0], COM, np.diag(TRUTH[4:7]))
    run = ideal(lib, trajectory, Plant(lib.pi0))
    columns = lib.regressor(run.q, run.dq, run.ddq)[:, :, mount.columns]
    box = columns @ np.linalg.solve(mount.to_frame, body)
    arm = replace(arm_model(lib), is_exact=not off)
    rng = np.random.default_rng(5)
    errors, held = [], []
    for _ in range(count):
        if off:
            run = ideal(lib, trajectory, Plant(perturbed(lib, lib.pi0, off, rng)))
        noise = NOISE * rng.normal(size=box.shape)
        if cutoff:
            b, a = signal.butter(4, cutoff / 50.0)
            noise = signal.filtfilt(b, a, noise, axis=0)
        noisy = run.replace(tau=run.tau + box + noise)
        payload = identify_payload(noisy, lib, arm=arm, gain_error=0.0)
        errors.append(payload.body.values - TRUTH)
        held.append(np.abs(errors[-1]) < NORMAL_95 * payload.body.sigma)
    wrong = np.array(errors)
    return Weighed(
        1e3 * float(np.sqrt(np.mean(wrong[:, 0] ** 2))),
        1e3 * float(np.sqrt(np.mean(np.sum(wrong[:, 1:4] ** 2, axis=1)))),
        float(np.mean(held)),
    )


CUTOFFS = (1.0, 2.0, 3.0, 5.0, 10.0)
FORMS = ("acceleration", "momentum")
DRAWS = 5
BELOW_RATE = 0.45


def lines(lib: Library, designs: Path) -> Iterator[tuple[str, str, list[float | None]]]:
    """Log, regressor and an error in % per cut-off, None where the rate is too low for it.

    Errors of base parameters, then torque errors on the last 40 % of panda_gaz.
    """
    hard = (("100 Hz, encoders of 256 counts", 100.0, 256), ("12.5 Hz", 12.5, None))
    for name, rate, counts in hard:
        for form in FORMS:
            errors = [simulated(lib, designs, rate, counts, form, f_c) for f_c in CUTOFFS]
            yield f"{name}: base parameters", form, errors
    log = runtime.read_recording("panda_gaz")
    for form in FORMS:
        errors = [of_panda(lib, log, form, f_c) for f_c in CUTOFFS]
        yield "Panda: low-passed torque", form, errors


def simulated(
    lib: Library, designs: Path, rate: float, counts: int | None, form: str, cutoff: float
) -> float | None:
    """Mean of 100 ‖β̂ − β‖/‖β‖ over noises."""
    if cutoff > BELOW_RATE * rate:
        return None
    pi = document_robot(lib)
    plant = Plant(pi, viscous=0.5, coulomb=0.3, torque_noise=0.05)
    beta, errors = lib.base_matrix @ pi, []
    usual = Preparation(filter="butterworth", cutoff_hz=cutoff, trim_s=0.5, regressor=form)
    for seed in range(DRAWS):
        rng = np.random.default_rng(seed)
        runs = []
        for design in trajectories(designs, lib):
            run = ideal(lib, design, plant, rate_hz=rate, rng=rng)
            q = run.q if counts is None else np.round(run.q * counts / 2 / np.pi)
            q = q if counts is None else q * 2 * np.pi / counts
            runs.append(run.replace(q=q, dq=None, ddq=None))
        result = fit(
            runs[0],
            lib,
            preparation=usual,
            friction=Friction(),
            validation=runs[1],
            test=runs[-1],
            certify=False,
        )
        errors.append(100 * np.linalg.norm(result.beta - beta) / np.linalg.norm(beta))
    return float(np.mean(errors))


def of_panda(lib: Library, log: Recording, form: str, cutoff: float) -> float:
    """Overall error of the torque low-passed at the same cut-off."""
    known = log.recipe.preparation if log.recipe else Preparation()
    usual = replace(known, filter="butterworth", cutoff_hz=cutoff, regressor=form)
    result = fit(log, lib, preparation=usual, certify=False)
    tau = samples_of(result.test, lib).tau
    return metrics.torque_error(tau, result.predict_recording(result.test)).overall
