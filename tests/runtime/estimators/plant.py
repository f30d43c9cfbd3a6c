"""The common simulated plant of the method tests: FR3, rotors, friction, noise, 20 Hz filter."""

from dataclasses import dataclass

import numpy as np

from runtime import Identification, Recording
from runtime.estimators.literature.iv_didim import ClosedLoop
from runtime.excitation import Trajectory
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation, Split
from runtime.simulation import Controller, Plant, closed_loop

ROTOR = np.array([0.3, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1])
COULOMB = np.array([0.5, 0.5, 0.4, 0.6, 0.3, 0.2, 0.1])
VISCOUS = np.array([0.5, 0.5, 0.4, 0.4, 0.2, 0.15, 0.1])
SPEED = 0.03
FRICTION = Friction(("coulomb", "viscous"), SPEED)
# 90 % for training, with the validation part for most methods; the test is another motion.
SPLIT = Split((0.0, 0.85), (0.85, 0.9), (0.9, 1.0))


def preparation(cutoff: float | None) -> Preparation:
    """Butterworth of order 4, both directions; 100 Hz; 50 ms off at the ends."""
    if cutoff is None:
        return Preparation(trim_s=0.05, rate_hz=100.0)
    return Preparation(filter="butterworth", cutoff_hz=cutoff, trim_s=0.05, rate_hz=100.0)


@dataclass(frozen=True)
class SimulatedCase:
    """A simulated robot that differs from its URDF, its log, and its true parameters."""

    lib: Library
    log: Recording
    lam_cad: np.ndarray
    pi: np.ndarray
    loop: ClosedLoop
    test: tuple[np.ndarray, ...]

    def identify(
        self, method: str, cutoff: float | None = 20.0, **options: object
    ) -> Identification:
        """Identify by one method, with all inputs that a method may need."""
        return identify_recording(
            self.log,
            self.lib,
            method,
            preparation=preparation(cutoff),
            **{
                "split": SPLIT,
                "friction": FRICTION,
                "lam0": self.lam_cad,
                "inputs": {"controller": self.loop},
                "certify": False,
                **options,
            },
        )

    def errors(self, result: Identification) -> np.ndarray:
        """Torque error in percent per joint on the clean test motion, friction included."""
        q, dq, ddq = self.test
        truth = self.lib.inverse_dynamics(q, dq, ddq, self.pi)
        truth = truth + COULOMB * np.tanh(dq / SPEED) + VISCOUS * dq
        wrong = result.predict(q, dq, ddq) - truth
        return 100 * np.sqrt(np.sum(wrong**2, axis=0) / np.sum(truth**2, axis=0))

    def base_error(self, result: Identification) -> float:
        """‖β̂ − β‖/‖β‖ in percent."""
        beta = self.lib.base_matrix @ self.pi
        return 100 * float(np.linalg.norm(result.beta - beta) / np.linalg.norm(beta))


def simulated_case(
    lib: Library,
    train: Trajectory,
    test: Trajectory,
    pi: np.ndarray,
    sigma_q: float,
    seed: int = 0,
    sigma_tau: float = 0.05,
    **plant: object,
) -> SimulatedCase:
    """A log of the plant; the CAD model is 5 % off in λ."""
    rng = np.random.default_rng(seed)
    lam = lib.lam_from_pi(pi)
    cad = lam * (1 + 0.05 * rng.normal(size=lam.size))
    robot = Plant(
        pi,
        **{
            "viscous": VISCOUS,
            "coulomb": COULOMB,
            "coulomb_speed": SPEED,
            "rotor": ROTOR,
            "position_noise": sigma_q,
            # The controller's speed comes from a filter of 30 Hz.
            "velocity_noise": sigma_q * 2 * np.pi * 30,
            "torque_noise": sigma_tau,
            **plant,
        },
    )
    controller = Controller(pi=lib.pi_from_lam(cad), feels_noise=True)
    log = closed_loop(lib, train, robot, rng, controller=controller).replace(dq=None)
    t = np.arange(0.0, test.duration, 0.05)
    return SimulatedCase(
        lib, log, cad, pi, ClosedLoop(train, controller, ROTOR), test.at(lib, t)[:3]
    )
