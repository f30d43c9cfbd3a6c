"""Metrics of one result: distance from the truth, torque errors, physical consistency."""

from dataclasses import dataclass

import numpy as np

from runtime.estimators.regression.samples import Samples
from runtime.experiments.study import Row
from runtime.identification.metrics import CONSISTENCY_TOLERANCE, airm, frobenius, torque_error
from runtime.library import Array, Library
from runtime.library.parameters import links, mass


@dataclass(frozen=True, slots=True)
class Scorer:
    """Reference to which results are compared."""

    lib: Library  # the robot
    test: Samples  # motion and torque that no method has used; without noise in simulation
    pi: Array | None  # (10 n,) true parameters; None where unknown
    configurations: Array  # (K, n) positions at which mass matrices are compared [rad, m]
    mass: Array  # (K, n, n) true mass matrices

    def row(self, pi: Array, friction: Array | None = None, unrepaired: float | None = None) -> Row:
        """Metrics of a result: airm, frobenius, torque errors, base error, consistency.

        pi (10 n,), friction (N, n) [N·m, N].
        """
        lib, test = self.lib, self.test
        predicted = lib.inverse_dynamics(test.q, test.dq, test.ddq, pi)
        if friction is not None:
            predicted = predicted + friction
        error = torque_error(test.tau, predicted)
        smallest = float(lib.relative_eigenvalues(pi).min())
        masses = mass(links(pi))
        possible = smallest >= -CONSISTENCY_TOLERANCE and (masses > 0).all()
        row: Row = {}
        if self.pi is not None:
            matrices = lib.mass_matrix(self.configurations, pi)
            distance = float(frobenius(self.mass, matrices).mean())
            beta, truth = lib.base_matrix @ pi, lib.base_matrix @ self.pi
            if possible:  # else the mass matrix may be indefinite, for which the AIRM is undefined
                row["airm"] = self.airm(pi)
            row |= {
                "frobenius": distance,
                "frobenius_rms": distance / lib.n_joints,
                "base_error": 100 * float(np.linalg.norm(beta - truth) / np.linalg.norm(truth)),
            }
        before = smallest if unrepaired is None else unrepaired
        row |= {"consistent": bool(possible), "smallest_eigenvalue": before}
        row["strict"] = bool(before > CONSISTENCY_TOLERANCE)
        row |= per_joint("tau_error", error.percent) | per_joint("tau_rms", error.rms)
        return row | {"tau_error": error.overall}

    def airm(self, pi: Array) -> float:
        """Mean affine-invariant distance of the mass matrices for π (10 n,)."""
        mass = self.lib.mass_matrix(self.configurations, pi)
        return float(airm(self.mass, mass).mean())


def scorer_of(lib: Library, test: Samples, pi: Array | None, configurations: int) -> Scorer:
    """Scorer at equally spaced configurations of the test trajectory."""
    rows = np.linspace(0, len(test) - 1, configurations).round().astype(int)
    q = np.ascontiguousarray(test.q[rows])
    mass = np.zeros((0, lib.n_joints, lib.n_joints)) if pi is None else lib.mass_matrix(q, pi)
    return Scorer(lib, test, pi, q, mass)


def per_joint(name: str, values: Array) -> Row:
    """Metrics `NAME_1` … `NAME_n`."""
    return {f"{name}_{joint}": float(x) for joint, x in enumerate(values, start=1)}


def torque_rms(tau: Array) -> Array:
    """RMS √(Σ τ²/N) per joint (n,) of torques (N, n) [N·m, N]."""
    return np.asarray(np.sqrt(np.mean(tau**2, axis=0)))
