"""Secs. 3.1.2, 3.2 and 4.5: checks of the model along the best exciting trajectory.

Fig. 3.1 compares Y π of the regressor with the recursive Newton–Euler torque τ(q, dq, ddq, π) and
with τ of λ (Eq. 4.3), which are separate kernels; Fig. 3.2 compares Y π with Y_b β; Fig. 4.1 is
the Taylor remainder of the loss (Eqs. 4.38–4.41).
"""

from dataclasses import dataclass

import numpy as np

from runtime.estimators.regression.factor import TorqueObjective
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.experiments.study import Arrays, Row, Study, StudyOutcome, View
from runtime.experiments.trials import designed, document_robot
from runtime.library import Array, Library
from runtime.recording import Recording
from runtime.simulation import Plant, ideal

JOINT = 4  # joint of Fig. 3.2, from 0


@dataclass(frozen=True, slots=True)
class ModelConfig:
    """Steps and point of the Taylor test."""

    seed: int = 0  # of the point and of the direction
    rate_hz: float = 100.0  # sample rate [Hz]
    perturbation: float = 0.15  # relative distance of λ̄ from the truth; Δ ~ N(0, 1) per entry
    steps: tuple[float, float, int] = (-1.0, -7.0, 25)  # exponents of largest and smallest ε, count
    straight: tuple[float, float] = (-5.0, -2.0)  # exponents of the slope, above rounding errors


@dataclass(frozen=True, slots=True)
class ModelSetup:
    """Best trajectory with the torque of the true robot."""

    lib: Library
    config: ModelConfig
    pi: Array
    recording: Recording
    samples: Samples


def _prepare(lib: Library, config: ModelConfig, needed: Arrays) -> ModelSetup:
    """Exact motion and torque of the best trajectory."""
    pi = document_robot(lib)
    recording = ideal(lib, designed(lib, needed)[0], Plant(pi), config.rate_hz)
    return ModelSetup(lib, config, pi, recording, samples_of(recording, lib))


def _run(setup: ModelSetup, numbers: range, threads: int) -> list[Row]:
    """Largest torque differences and the slope of the Taylor remainder."""
    tau = _torques(setup)
    steps, remainders = _taylor(setup)
    kept = _straight(setup.config, steps)
    slope = np.polyfit(np.log(steps[kept]), np.log(remainders[kept]), 1)[0]

    def row(case: str, **figures: float) -> Row:
        return {"case": case, "method": "check", "trial": 0} | figures

    def apart(one: str, other: str) -> float:
        return float(np.abs(tau[one] - tau[other]).max())

    return [
        row("regressor", difference=apart("idm", "regressor")),
        row("lambda", difference=apart("idm", "lambda")),
        row("base regressor", difference=apart("regressor", "base")),
        row("taylor", slope=float(slope)),
    ]


def _finish(setup: ModelSetup, rows: list[Row]) -> StudyOutcome:
    """Curves of the three figures."""
    tau, (steps, remainders) = _torques(setup), _taylor(setup)
    middle = int(np.flatnonzero(_straight(setup.config, steps))[0])
    series = {
        "t": np.asarray(setup.recording.t),
        "tau_idm": tau["idm"],
        "tau_regressor": tau["regressor"],
        "tau_5_full": tau["regressor"][:, JOINT],
        "tau_5_base": tau["base"][:, JOINT],
        "step": steps,
        "remainder": remainders,
        "slope_two": remainders[middle] * (steps / steps[middle]) ** 2,
    }
    facts = {
        "rate_hz": setup.config.rate_hz,
        "samples": len(setup.samples),
        "motion": "the best trajectory of the excitation study",
        "compared": "Y pi of the generated regressor against the generated recursive Newton-Euler "
        "torque in pi and in lambda; Y pi against Y_b beta",
        "loss": "Eq. 4.5 on all samples, weights of Eq. 4.8",
        "seed": setup.config.seed,
    }
    return StudyOutcome(series, facts)


def _torques(setup: ModelSetup) -> dict[str, Array]:
    lib, pi = setup.lib, setup.pi
    motion = setup.samples.q, setup.samples.dq, setup.samples.ddq
    return {
        "idm": lib.inverse_dynamics(*motion, pi),
        "lambda": lib.torque(*motion, lib.lam_from_pi(pi)),
        "regressor": np.asarray(lib.regressor(*motion) @ pi),
        "base": np.asarray(lib.base_regressor(*motion) @ (lib.base_matrix @ pi)),
    }


def _taylor(setup: ModelSetup) -> tuple[Array, Array]:
    """ε and |R(ε)| = |L(λ̄ + εΔ) − L(λ̄) − ε ∇Lᵀ Δ|."""
    lib, config, samples = setup.lib, setup.config, setup.samples
    rng = np.random.default_rng(config.seed)
    lam = lib.lam_from_pi(setup.pi)
    point = lam * (1 + config.perturbation * rng.normal(size=lam.size))
    direction = rng.normal(size=lam.size)
    objective = TorqueObjective(lib, samples, thesis_weights(samples.tau))
    value, gradient = objective.value_gradient(point)
    first, last, count = config.steps
    steps = np.logspace(first, last, count)
    values = np.array([objective.value_gradient(point + e * direction)[0] for e in steps])
    return steps, np.abs(values - value - steps * (gradient @ direction))


def _straight(config: ModelConfig, steps: Array) -> Array:
    low, high = config.straight
    return np.asarray((np.log10(steps) >= low - 1e-9) & (np.log10(steps) <= high + 1e-9))


STUDY = Study(
    name="model",
    title="Checks of the model: regressors and gradient",
    config=ModelConfig(),
    prepare=_prepare,
    run=_run,
    finish=_finish,
    cases={
        "regressor": "Y π against Newton–Euler in π, all joints, N·m",
        "lambda": "Newton–Euler in λ against the same in π, all joints, N·m",
        "base regressor": "Y_b β against Y π, all joints, N·m",
        "taylor": "slope of log |R| over log ε",
    },
    methods={"check": "largest difference over the trajectory, or slope"},
    trials=1,
    needs=("excitation",),
    views=(
        View(
            "fig-3.1",
            "lines",
            "Torque of regressor and inverse dynamics",
            cases=("regressor", "lambda"),
            metrics=("difference",),
            series=("t", "tau_idm", "tau_regressor"),
            axes=("time [s]", "torque [N·m]"),
        ),
        View(
            "fig-3.2",
            "lines",
            "Torque of joint 5 by the full and the base regressor",
            cases=("base regressor",),
            metrics=("difference",),
            series=("t", "tau_5_full", "tau_5_base"),
            axes=("time [s]", "torque [N·m]"),
        ),
        View(
            "fig-4.1",
            "loglog",
            "Taylor remainder of the loss",
            cases=("taylor",),
            metrics=("slope",),
            series=("step", "remainder", "slope_two"),
            axes=("ε", "|R(ε)|"),
        ),
    ),
)
