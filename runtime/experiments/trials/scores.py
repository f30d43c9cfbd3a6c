"""The figures of one answer: how far from the truth, how well it predicts, whether it can exist."""

from dataclasses import dataclass

import numpy as np

from runtime.estimators.regression.samples import Samples
from runtime.experiments.study import Row
from runtime.identification import metrics
from runtime.library import Array, Library
from runtime.library.parameters import links, mass


@dataclass(frozen=True, slots=True)
class Scorer:
    """What answers are held against.

    Attributes:
        test: motion and torque that no method has seen; its torque without noise in simulation.
        pi: the truth, None where there is none.
        configurations: q at which mass matrices are compared, (K, n).
        mass: true mass matrices there, (K, n, n).
    """

    lib: Library
    test: Samples
    pi: Array | None
    configurations: Array
    mass: Array

    def row(self, pi: Array, friction: Array | None = None) -> Row:
        """airm, frobenius, torque errors per joint, base error, consistency.

        Args:
            pi: (10 n,) the answer.
            friction: F φ on the test samples, (N, n).
        """
        lib, test = self.lib, self.test
        predicted = lib.inverse_dynamics(test.q, test.dq, test.ddq, pi)
        if friction is not None:
            predicted = predicted + friction
        error = metrics.torque_error(test.tau, predicted)
        smallest = float(lib.relative_eigenvalues(pi).min())
        masses = mass(links(pi))
        possible = smallest >= -metrics.CONSISTENCY_TOLERANCE and (masses > 0).all()
        row: Row = {}
        if self.pi is not None:
            matrices = lib.mass_matrix(self.configurations, pi)
            frobenius = float(metrics.frobenius(self.mass, matrices).mean())
            beta, truth = lib.base_matrix @ pi, lib.base_matrix @ self.pi
            if possible:  # of others the mass matrix may be indefinite, at no distance at all
                row["airm"] = self.airm(pi)
            row |= {
                "frobenius": frobenius,
                "frobenius_rms": frobenius / lib.n_joints,
                "base_error": 100 * float(np.linalg.norm(beta - truth) / np.linalg.norm(truth)),
            }
        row |= {"consistent": bool(possible), "smallest_eigenvalue": smallest}
        row |= per_joint("tau_error", error.percent) | per_joint("tau_rms", error.rms)
        return row | {"tau_error": error.overall}

    def airm(self, pi: Array) -> float:
        """Mean affine-invariant distance of the mass matrices over the configurations."""
        mass = self.lib.mass_matrix(self.configurations, pi)
        return float(metrics.airm(self.mass, mass).mean())


def scorer_of(lib: Library, test: Samples, pi: Array | None, configurations: int) -> Scorer:
    """Equally spaced configurations of the test trajectory."""
    rows = np.linspace(0, len(test) - 1, configurations).round().astype(int)
    q = np.ascontiguousarray(test.q[rows])
    mass = np.zeros((0, lib.n_joints, lib.n_joints)) if pi is None else lib.mass_matrix(q, pi)
    return Scorer(lib, test, pi, q, mass)


def per_joint(name: str, values: Array) -> Row:
    """`NAME_1` … `NAME_n` of values (n,)."""
    return {f"{name}_{joint}": float(x) for joint, x in enumerate(values, start=1)}


def torque_rms(tau: Array) -> Array:
    """√(Σ τ²/N) per joint of (N, n), N·m."""
    return np.asarray(np.sqrt(np.mean(tau**2, axis=0)))
