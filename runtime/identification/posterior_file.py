"""posterior.npz beside result.json: data and prior of the posterior of π and φ.

    p(π, φ) ∝ exp(−‖R [K π; φ] − r‖² / 2S − κ Σ_k [tr(P0_k⁻¹ P_k) − log det P_k])

Given π, φ is normal: U φ = t − O π + √S ε with the triangle U of its columns. To second order π is
normal with the root L_π of `Uncertainty`, so that a root of the covariance of [β; φ] is

    L = [K L_π, 0;  −U⁻¹ O L_π, √S U⁻¹]

The file states π of its result.json and is refused beside another one.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.linalg import solve_triangular

from runtime.common.files import replacing, require_file
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.convex import bodies_of, reduce
from runtime.estimators.convex.eliminate_friction import Elimination, Reduced
from runtime.estimators.regression import Statistics
from runtime.estimators.uncertainty import Information, Uncertainty
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.recording.formats.npz import open_npz

FILE = "posterior.npz"
_ARRAYS = ("factor", "target", "base_matrix", "centre", "pi", "pi_root")
_NUMBERS = ("rest", "n_samples", "density", "kappa", "logs")


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Posterior of π and of the friction coefficients φ.

    Attributes:
        information: data and prior.
        pi: π of the result, (10 n,).
        pi_root: L_π, root of the covariance of π, (10 n, columns).
        joints: number n of joints, the rows of φ.
        logs: number of logs with offsets of their own; 0 for one log. The offset is their mean.
    """

    information: Information
    pi: Array
    pi_root: Array
    joints: int
    logs: int

    def reduced(self, lib: Library) -> tuple[Reduced, Elimination]:
        """Least squares over π, and the system that gives φ."""
        return reduce(self.information.statistics, lib.n_joints)

    def root(self, lib: Library) -> Array:
        """Root of the covariance of [β; φ], (n_b + n k, columns)."""
        _, system = self.reduced(lib)
        over_pi = self.pi_root
        phi = np.hstack([self.phi_slope(system) @ over_pi, self.phi_root(system)])
        beta = self.information.statistics.base_matrix @ over_pi
        beta = np.hstack([beta, np.zeros((len(beta), phi.shape[1] - beta.shape[1]))])
        return np.vstack([beta, self.usual(phi)])

    def usual_phi_slope(self, system: Elimination) -> Array:
        """Slope ∂φ/∂π of the best φ, (n k, 10 n), the offset averaged over logs."""
        return self.usual(self.phi_slope(system))

    def usual_phi_root(self, system: Elimination) -> Array:
        """Root of the covariance of φ at known π, (n k, rank), the offset averaged over logs."""
        return self.usual(self.phi_root(system))

    @staticmethod
    def phi_slope(system: Elimination) -> Array:
        """Slope ∂φ/∂π, one row per friction coefficient."""
        rank = len(system.matrix)
        slope = np.zeros((system.lengths.size, system.over_pi.shape[1]))
        if rank:
            slope[system.order[:rank]] = -solve_triangular(system.matrix, system.over_pi)
        return slope / system.lengths[:, None]

    def phi_root(self, system: Elimination) -> Array:
        """Root √S U⁻¹ of the covariance of φ at known π, one row per friction coefficient."""
        rank = len(system.matrix)
        root = np.zeros((system.lengths.size, rank))
        if rank:
            inverse = solve_triangular(system.matrix, np.eye(rank))
            root[system.order[:rank]] = np.sqrt(self.information.density) * inverse
        return root / system.lengths[:, None]

    def usual(self, rows: Array) -> Array:
        """Rows of φ with the offsets of several logs averaged, (n k, …)."""
        if not self.logs:
            return rows
        by_joint = rows.reshape(self.joints, -1, rows.shape[1])
        shared, offsets = by_joint[:, : -self.logs], by_joint[:, -self.logs :]
        mean = offsets.mean(axis=1, keepdims=True)
        return np.concatenate([shared, mean], axis=1).reshape(-1, rows.shape[1])


def write_posterior(folder: Path, uncertainty: Uncertainty, pi: Array, logs: int = 0) -> None:
    """Write posterior.npz into the folder of a result, as a whole or not at all."""
    information = uncertainty.information
    if information is None:
        return
    s = information.statistics
    values = {"factor": s.factor, "target": s.target, "base_matrix": s.base_matrix}
    values |= {"centre": information.centre, "pi": pi, "pi_root": uncertainty.root}
    numbers = {"rest": s.rest, "n_samples": s.n_samples, "density": information.density}
    numbers |= {"kappa": information.kappa, "logs": logs}
    with replacing(folder / FILE) as file:
        whole = values | {key: np.asarray(value) for key, value in numbers.items()}
        np.savez(file, model_hash=np.asarray(s.model_hash), **whole)


def read_posterior(result: Path, saved: SavedResult, lib: Library) -> Posterior:
    """Read the posterior of a result."""
    path = (result if result.is_dir() else result.parent) / FILE
    try:
        file = open_npz(require_file(path).read_bytes(), path.name)
        arrays = {key: np.array(file[key], dtype=float) for key in _ARRAYS}
        numbers = {key: float(file[key]) for key in _NUMBERS}
        model_hash = str(file["model_hash"])
    except FileNotFoundError:
        raise IdentificationError(
            f"expected '{path}', which identify writes beside result.json, and there is none; "
            "identify again with this version and a method that states uncertainties"
        ) from None
    except (OSError, RecordingError, ValueError, KeyError, TypeError):
        raise IdentificationError(
            f"'{path}' is damaged or holds no posterior; identify again"
        ) from None
    if not np.array_equal(arrays["pi"], saved.pi):
        raise IdentificationError(
            f"'{path}' belongs to another result.json than the one beside it; identify again"
        )
    size, logs = arrays["target"].size, int(numbers["logs"])
    base = arrays["base_matrix"]
    if base.shape != lib.base_matrix.shape or not np.allclose(base, lib.base_matrix, atol=1e-9):
        raise IdentificationError(
            f"'{path}' has other base parameters than '{lib.name}' has now; identify again"
        )
    columns = saved.phi.shape[1] + max(logs - 1, 0)
    every = np.concatenate([values.ravel() for values in arrays.values()])
    fits = (
        arrays["factor"].shape == (size, size)
        and size == len(base) + lib.n_joints * columns
        and arrays["centre"].shape == lib.pi0.shape
        and arrays["pi_root"].ndim == 2
        and len(arrays["pi_root"]) == len(lib.pi0)
        and np.isfinite([*every, *numbers.values()]).all()
        and numbers["density"] > 0
        and numbers["kappa"] > 0
        and numbers["rest"] >= 0
        and numbers["n_samples"] > 0
        and logs >= 0
        and bodies_of(lib).log_det(arrays["centre"]) is not None
    )
    if not fits:
        raise IdentificationError(
            f"'{path}' is damaged (its arrays do not fit together); identify again"
        )
    statistics = Statistics(
        factor=arrays["factor"],
        target=arrays["target"],
        rest=numbers["rest"],
        n_samples=numbers["n_samples"],
        base_matrix=base,
        model_hash=model_hash,
    )
    known = Information(statistics, numbers["density"], numbers["kappa"], arrays["centre"])
    return Posterior(known, arrays["pi"], arrays["pi_root"], lib.n_joints, logs)
