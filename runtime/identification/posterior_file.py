"""posterior.npz beside result.json: data and prior of the posterior of π and φ, and σ of φ.

    p(π, φ) ∝ exp(−‖R [K π; φ] − r‖² / 2S − κ Σ_k [tr(P0_k⁻¹ P_k) − log det P_k])

Given π, φ is normal: U φ = t − O π + √S ε with the triangle U of its columns. To second order π is
normal with the root L_π of `Uncertainty`, so that roots of the covariance of [β; φ] and of φ are

    L = [K L_π, 0;  −U⁻¹ O L_π, √S U⁻¹],   L_φ = [−U⁻¹ O L_π, √S U⁻¹, φ − U⁻¹ (t − O π)]

with what the estimate of φ differs from the best one at its π, as in methods with other weights.
L_π contains nuisance torque, errors of torque gains, and the delay and encoder biases that are
estimated. A coefficient without an interval has NaN: its column is zero or a combination of other
friction columns, it is held at the bound 0, or learned friction shares its torque.

The file states π of its result.json and is refused beside another one.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from runtime.common.files import bytes_of, folder_of
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import bodies_of
from runtime.estimators.regression.factor import Elimination, Reduced, reduce
from runtime.estimators.regression.posterior import posterior_of
from runtime.estimators.uncertainty import LogInformation, without_gains
from runtime.identification.result_record import FrictionPart
from runtime.identification.saved_result import POSTERIOR, SavedResult
from runtime.library import Array, Library, Mask
from runtime.recording.formats.npz import open_npz, record_from_arrays, refusing
from runtime.recording.settings import SPRING


@dataclass(frozen=True, slots=True, eq=False)
class SavedPosterior:
    """Posterior of π and of the friction coefficients φ, as its file holds it."""

    information: LogInformation  # data and prior
    pi: Array  # π of the result, (10 n,)
    pi_root: Array  # L_π, root of the covariance of π, (10 n, columns)
    logs: Annotated[int, Meta(ge=0)]  # logs with offsets of their own, whose mean is stated
    phi_nuisance: Array | None = None  # by the m columns of L_π behind 10 n at known π, (n k, m)
    gains: Annotated[int, Meta(ge=0)] = 0  # columns of torque gains before the last of L_π
    joints: int = 0  # number n of joints, the rows of φ; the library states it

    def of_readings(self) -> "SavedPosterior":
        """The posterior of what predicts readings of the same sensors: without their gains."""
        root, known = without_gains(self.pi_root, self.gains), self.phi_nuisance
        if known is not None and known.size:
            known = known[:, : known.shape[1] - self.gains]
        return replace(self, pi_root=root, phi_nuisance=known, gains=0)

    def reduced(self, lib: Library) -> tuple[Reduced, Elimination]:
        """Least squares over π, and the system that gives φ."""
        return reduce(self.information.statistics, lib.n_joints)

    def root(self, lib: Library) -> Array:
        """Root of the covariance of [β; φ], (n_b + n k, columns)."""
        _, system = self.reduced(lib)
        phi = self.phi_rows(system)
        beta = self.information.statistics.base_matrix @ self.pi_root
        beta = np.hstack([beta, np.zeros((len(beta), phi.shape[1] - beta.shape[1]))])
        return np.vstack([beta, self.usual(phi)])

    def phi_over(self, system: Elimination) -> Array:
        """What the columns of L_π move φ, (n k, columns)."""
        moved = system.slope @ self.pi_root
        if self.phi_nuisance is not None and self.phi_nuisance.size:
            first = len(self.pi_root)
            moved[:, first : first + self.phi_nuisance.shape[1]] += self.phi_nuisance
        return moved

    def phi_rows(self, system: Elimination) -> Array:
        """Root of the covariance of φ, by π and at known π, (n k, columns)."""
        return np.hstack([self.phi_over(system), self.phi_root(system)])

    def phi_root(self, system: Elimination) -> Array:
        """Root √S U⁻¹ of the covariance of φ at known π, one row per friction coefficient."""
        return np.asarray(np.sqrt(self.information.density) * system.root)

    def usual(self, rows: Array) -> Array:
        """Rows of φ with the offsets of several logs averaged, (n k, …)."""
        if not self.logs:
            return rows
        by_joint = rows.reshape(self.joints, -1, rows.shape[1])
        shared, offsets = by_joint[:, : -self.logs], by_joint[:, -self.logs :]
        mean = offsets.mean(axis=1, keepdims=True)
        return np.concatenate([shared, mean], axis=1).reshape(-1, rows.shape[1])


def read_posterior(result: Path, saved: SavedResult, lib: Library) -> SavedPosterior:
    """Read the posterior of a result."""
    path = folder_of(result) / POSTERIOR
    with refusing(
        f"expected '{path}', which identify writes beside result.json, and there is none; "
        "identify again with this version and a method that states uncertainties",
        f"'{path}' is damaged or holds no posterior; identify again",
    ):
        stored = record_from_arrays(SavedPosterior, open_npz(bytes_of(path), path.name), path.name)
    if not np.array_equal(stored.pi, saved.pi):
        raise IdentificationError(
            f"'{path}' belongs to another result.json than the one beside it; identify again"
        )
    data, logs, centre = stored.information.statistics, stored.logs, stored.information.centre
    size, base = data.target.size, data.base_matrix
    if base.shape != lib.base_matrix.shape or not np.allclose(base, lib.base_matrix, atol=1e-9):
        raise IdentificationError(
            f"'{path}' has other base parameters than '{lib.name}' has now; identify again"
        )
    columns = saved.phi.shape[1] + max(logs - 1, 0)
    root, moved = stored.pi_root, stored.phi_nuisance
    fits = (
        (moved is None or (moved.shape[:1] == (size - len(base),) and np.isfinite(moved).all()))
        and data.factor.shape == (size, size)
        and size == len(base) + lib.n_joints * columns
        and centre.shape == lib.pi0.shape
        and root.ndim == 2
        and stored.gains < root.shape[1]
        and len(root) == len(lib.pi0)
        and all(np.isfinite(each).all() for each in (data.factor, data.target, centre, root))
        and bodies_of(lib).log_det(centre) is not None
    )
    if not fits:
        raise IdentificationError(
            f"'{path}' is damaged (its arrays do not fit together); identify again"
        )
    return replace(stored, joints=lib.n_joints)


def spring_lines(friction: FrictionPart | None) -> list[str]:
    """One line per spring of unknown stiffness: its constant with the 95 % interval."""
    lines: list[str] = []
    if friction is None:
        return lines
    for place, column in enumerate(friction.columns):
        if column.startswith(SPRING):
            value, ends = friction.values[0][place], friction.interval_95
            pair = ends and ends[0][place]
            spread = (
                f", 95 % interval {pair[0]:.5g} to {pair[1]:.5g}" if pair else ", without interval"
            )
            lines.append(
                f"spring {column.removeprefix(SPRING)}: stiffness {value:.5g}{spread} (SI units)"
            )
    return lines


def determined(columns: Array) -> Mask:
    """Whether each column (rows, m) is neither zero nor in a combination that is zero, (m,)."""
    return columns.any(axis=0) & np.isfinite(posterior_of(columns).sigma)
