"""Table 3.1 as an experiment: every method on one log of the same simulated plant.

The plant has rotors, viscous and Coulomb friction, and a computed-torque controller whose CAD model
has an error of 5 %. The test is another motion in closed loop, without noise.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.estimators.literature.iv_didim import ClosedLoop
from runtime.estimators.methods import METHODS
from runtime.experiments.study import TORQUE, Arrays, Row, Study, StudyOutcome, View
from runtime.experiments.trials import designed, document_robot, per_joint, stream, torque_rms
from runtime.identification.comparison.run import Figures, TrueParameters, compare
from runtime.identification.problem_setup import Assembly, assemble
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.simulation import Controller, Plant, closed_loop

CAD, TRAINING, VALIDATION = range(3)  # random streams of the study
FRICTION = Friction(("coulomb", "viscous"), 0.03)
PREPARATION = Preparation(filter="butterworth", cutoff_hz=20.0, trim_s=0.05, rate_hz=100.0)


@dataclass(frozen=True, slots=True)
class MethodsConfig:
    """Simulated plant."""

    seed: int = 0
    methods: tuple[str, ...] = METHODS.builtin  # one trial each
    cad: float = 0.05  # relative error of λ of the CAD model
    sigma_q: float = 1e-4  # sigma_q, sigma_tau: noise of positions [rad] and torques [N·m]
    sigma_tau: float = 0.05
    speed_hz: float = 30.0  # cut-off f of the velocity filter of the controller: σ_dq = 2π f σ_q
    rotor: tuple[float, ...] = (0.3, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1)
    coulomb: tuple[float, ...] = (0.5, 0.5, 0.4, 0.6, 0.3, 0.2, 0.1)
    viscous: tuple[float, ...] = (0.5, 0.5, 0.4, 0.4, 0.2, 0.15, 0.1)
    friction: Friction = FRICTION
    preparation: Preparation = PREPARATION


@dataclass(frozen=True, slots=True)
class MethodsSetup:
    """Problem that all methods share, and the truth."""

    lib: Library
    config: MethodsConfig
    assembly: Assembly
    truth: TrueParameters
    test: Array


def _prepare(lib: Library, config: MethodsConfig, needed: Arrays) -> MethodsSetup:
    """Simulate three logs of the plant and set up the common problem."""
    pi = document_robot(lib)
    lam = lib.lam_from_pi(pi)
    cad = lam * (1 + config.cad * stream(config.seed, 0, CAD).normal(size=lam.size))
    clean = Plant(pi, viscous=config.viscous, coulomb=config.coulomb, rotor=config.rotor)
    clean = replace(clean, coulomb_speed=config.friction.coulomb_speed)
    noisy = replace(clean, position_noise=config.sigma_q, torque_noise=config.sigma_tau)
    noisy = replace(noisy, velocity_noise=2 * np.pi * config.speed_hz * config.sigma_q)
    law = Controller(pi=lib.pi_from_lam(cad), feels_noise=True)
    designs = designed(lib, needed)

    def log(number: int, plant: Plant) -> Recording:
        rng = stream(config.seed, 0, TRAINING + number)
        return closed_loop(lib, designs[number], plant, rng, controller=law).replace(dq=None)

    assembly = assemble(
        log(0, noisy),
        lib,
        preparation=config.preparation,
        friction=config.friction,
        validation=log(1, noisy),
        test=log(2, clean),
        lam0=cad,
        inputs={"controller": ClosedLoop(designs[0], law, np.array(config.rotor))},
    )
    tau = assembly.parts[2].required("tau")
    truth = TrueParameters(lib.base_matrix @ pi, "plant", "")
    return MethodsSetup(lib, config, assembly, truth, tau)


def _row(setup: MethodsSetup, number: int) -> Row:
    method = setup.config.methods[number]
    compared = compare(setup.assembly, [method], truth=setup.truth).rows[0]
    if "interrupted by the user" in compared.status:
        raise KeyboardInterrupt
    row: Row = {"case": "plant", "method": method, "trial": number, "status": compared.status}
    return row if compared.figures is None else row | _figures(setup, compared.figures)


def _figures(setup: MethodsSetup, f: Figures) -> Row:
    percent = 100 * f.rms / torque_rms(setup.test)
    row: Row = {
        "tau_error": f.test_percent,
        "base_error": f.base_error_percent,
        "smallest_eigenvalue": f.smallest_relative_eigenvalue,
        "consistent": f.consistent,
        "time_s": f.seconds,
    }
    if f.iterations is not None:
        row["iterations"] = f.iterations
    if np.isfinite(f.gap_to_convex_optimum):
        row["gap"] = f.gap_to_convex_optimum
    return row | per_joint("tau_error", percent) | per_joint("tau_rms", f.rms)


def _finish(setup: MethodsSetup, rows: list[Row]) -> StudyOutcome:
    """Facts of the data; there are no series."""
    config, parts = setup.config, setup.assembly.parts
    facts: dict[str, Any] = {
        "plant": "closed loop of the compiled simulator: rotors, friction, computed torque with "
        f"a CAD model {100 * config.cad:g} % off in lambda",
        "preparation": list(parts[0].history),
        "samples": {
            name: len(part)
            for name, part in zip(("train", "validation", "test"), parts, strict=True)
        },
        "friction_columns": config.friction.facts(),
        "weights": setup.assembly.problem.weights.tolist(),
        "test": "another motion in closed loop, without noise, filtered alike",
        "torque_rms": {"test": torque_rms(setup.test).tolist()},
        "seed": config.seed,
    }
    return StudyOutcome(facts=facts)


STUDY = Study(
    name="methods",
    title="Every method side by side",
    config=MethodsConfig(),
    prepare=_prepare,
    run=lambda setup, numbers, _: [_row(setup, number) for number in numbers],
    finish=_finish,
    cases={"plant": "FR3 with rotors and friction, σ_q = 1e-4 rad, σ_τ = 0.05 N·m, 20 Hz"},
    methods={name: METHODS[name].sentence for name in METHODS.builtin},
    trials=len(METHODS.builtin),
    needs=("excitation",),
    per_chunk=1,
    views=(
        View(
            "table-3.1",
            "table",
            "Every method on the same log",
            ("plant",),
            (
                *("tau_error", "base_error", "consistent", "smallest_eigenvalue", "gap"),
                *("iterations", "time_s"),
                *TORQUE,
            ),
        ),
    ),
)
