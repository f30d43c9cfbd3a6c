"""Prepared recording → samples: motion, torque and friction columns of an identification.

Their residuals are r = Y π + F φ − τ, with a noise per joint and an autocorrelation. The effective
sample size of filtered residuals is estimated by `coloured_noise`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError, NeedsError
from runtime.library import Array, Integers, Library
from runtime.recording import Recording
from runtime.recording.friction.coupled_motors import Coupling, coupling_of, shape_of, spread
from runtime.recording.friction.model import torque as friction_torque
from runtime.recording.recording import complete_arrays

NORMAL_95 = 1.959963984540054  # half width of the 95 % interval of a standard normal variable
LAGS = 24  # lags of the autocorrelation, in samples
SILENT = 1e-6  # residual, relative to the largest RMS torque of a joint, below which it is rounding
ARRAYS = ("q", "dq", "acceleration", "tau", "columns", "base")
THESIS_SIGMA = 0.5  # regularisation of Eq. 4.8, N·m


def thesis_weights(tau: Array, unit: float = 1.0) -> Array:
    """Weights w_k ∝ 1/(τ_rms,k² + σ²) with mean 1, (n,), of torques (N, n) (Eq. 4.8)."""
    raw = 1.0 / (np.mean(tau**2, axis=0) + (unit * THESIS_SIGMA) ** 2)
    return raw / raw.mean()


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Complete motion and torque of a recording, with its friction columns (N, n, k)."""

    q: Array  # q, dq: joint positions and velocities, (N, n) [rad, m and their derivatives]
    dq: Array
    acceleration: Array | None  # ddq, (N, n); None for rows without it, which have `base`
    tau: Array  # torque (N, n) [N·m, N], or the power (N, 1) [W] where `base` is that of energy
    columns: Array  # friction columns, (N, n, k)
    coupling: Coupling | None = field(default=None, kw_only=True)  # of motors of several joints
    base: Array | None = field(default=None, kw_only=True)  # Y_b, (N, m, n_b), if not of q, dq, ddq

    def __len__(self) -> int:
        return len(self.q)

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of φ: (n, k), or (1, k) where rows mix joints."""
        return shape_of(self.columns, self.coupling)

    @property
    def ddq(self) -> Array:
        """Accelerations (N, n)."""
        if self.acceleration is None:
            raise NeedsError(
                "expected accelerations, got rows prepared without; use the regressor "
                "'acceleration', or a method that works on compressed statistics, such as map"
            )
        return self.acceleration

    @property
    def equations(self) -> int:
        """Number m of equations per sample."""
        return int(self.tau.shape[1])

    def rows(self, taken: slice | NDArray[Any]) -> "Samples":
        """Return some of the samples, contiguous."""
        return self.mapped(lambda key, x: np.ascontiguousarray(x[taken], dtype=float))

    def mapped(self, change: Callable[[str, Array], Array]) -> "Samples":
        """The samples with each of their arrays changed, by its name and value."""
        arrays = {key: getattr(self, key) for key in ARRAYS}
        changed: dict[str, Any] = {k: change(k, x) for k, x in arrays.items() if x is not None}
        return replace(self, **changed)

    def weighted(self, weights: Array) -> "Samples":
        """Rows, columns and torque times √w, weights (N,) or (N, m)."""
        root = np.sqrt(weights)

        def scaled(key: str, x: Array) -> Array:
            of_rows = key in {"tau", "columns", "base"}
            return x * root.reshape(*root.shape, *(1,) * (x.ndim - root.ndim)) if of_rows else x

        return self.mapped(scaled)

    @staticmethod
    def joined(parts: Sequence["Samples"]) -> "Samples":
        """Samples of several parts, one after the other."""
        return parts[0].mapped(lambda key, _: np.concatenate([getattr(x, key) for x in parts]))

    def rigid(self, lib: Library, pi: Array) -> Array:
        """Rigid-body torque Y π, (N, m) [N·m, N; W for rows of power]."""
        if self.base is not None:
            return np.asarray(self.base @ (lib.base_matrix @ pi))
        return lib.inverse_dynamics(self.q, self.dq, self.ddq, pi)

    def base_torque(self, lib: Library, x: Array) -> Array:
        """Torque Y_b β + F φ of x = [β; φ], (N, m) [N·m, N; W for rows of power]."""
        beta, phi = np.split(x, [len(lib.base_matrix)])
        if self.base is not None:
            rigid = self.base @ beta
        else:
            rigid = lib.base_inverse_dynamics(self.q, self.dq, self.ddq, beta)
        return np.asarray(rigid + self.friction(phi))

    def base_rows(self, lib: Library) -> Array:
        """Regressor Y_b of the base parameters, (N, m, n_b)."""
        return lib.base_regressor(self.q, self.dq, self.ddq) if self.base is None else self.base

    def friction(self, phi: Array) -> Array:
        """Friction torque F φ, (N, m), from φ (n, k) or (n k,); 0 without coefficients."""
        if not phi.size:
            return np.zeros_like(self.tau)
        torque = friction_torque(self.columns, phi.reshape(self.shape), self.coupling)
        return torque.sum(axis=1, keepdims=True) if self._is_power else torque

    def column_sizes(self) -> Array:
        """RMS of the friction columns by coefficient, (n, k)."""
        sizes = np.sqrt(np.mean(np.square(self.columns), axis=0))
        return sizes if self.coupling is None else self.coupling.sizes(sizes)

    def rows_of_unknowns(self, lib: Library) -> Array:
        """Rows [Y_b F] over x = [β; φ], (N, m, n_b + n k)."""
        return np.concatenate([self.base_rows(lib), self.friction_rows()], axis=2)

    def friction_rows(self) -> Array:
        """Friction columns as rows F over [φ], (N, m, n k)."""
        rows = spread(self.columns, self.coupling)
        return rows.sum(axis=1, keepdims=True) if self._is_power else rows

    @property
    def _is_power(self) -> bool:
        return self.equations < self.q.shape[1]


def samples_of(recording: Recording, lib: Library) -> Samples:
    """Samples of a recording that is complete, finite and of this robot.

    Their τ is without the torque of springs and other known parts.
    """
    n = lib.n_joints
    if recording.has_unknown_gains:
        raise IdentificationError(
            f"the recording '{recording.name}' holds motor currents whose gains are unknown, "
            "expected torques; write gain = [...] in N·m/A under [torque] of the recipe, with the "
            "gains of identify (result.json, current_gains) or of symgen gains"
        )
    has_rows = recording.rows is not None
    data = complete_arrays(recording, "dq", "tau", "rows" if has_rows else "ddq")
    q, dq, tau, rows = data["q"], data["dq"], data["tau"], data.get("rows")
    if q.shape[1] != n:
        raise IdentificationError(
            f"the recording '{recording.name}' has {q.shape[1]} joints, the robot "
            f"'{lib.name}' has {n}: {', '.join(lib.joint_names)}"
        )
    coupling = coupling_of(recording)
    known = lib.known_torque(q)
    if rows is not None and rows.shape[1] == 1:
        # Of power: each column is scaled with the speed of what it belongs to.
        tau, coupling = (tau - known * dq).sum(axis=1, keepdims=True), None
    else:
        tau = tau - known
    return Samples(q, dq, data.get("ddq"), tau, data["columns"], coupling=coupling, base=rows)


def names_of_equations(names: tuple[str, ...], count: int) -> tuple[str, ...]:
    """Names of rows where as many equations are these rows, else numbers."""
    return names if count == len(names) else tuple(f"equation {k + 1}" for k in range(count))


def residuals(lib: Library, samples: Samples, pi: Array, phi: Array) -> Array:
    """Residuals r = Y π + F φ − τ, (N, m) [N·m, N; W for rows of power]."""
    return samples.rigid(lib, pi) - samples.tau + samples.friction(phi)


def noise(rest: Array, lib: Library, n_phi: int, inflation: float = 1.0) -> Array:
    """Noise s_j per joint, (n,): RMS of the residual, corrected for what the unknowns absorb.

    Each unknown absorbs the noise of one independent sample, `inflation` times that of a row.
    """
    used = inflation * (len(lib.base_columns) + n_phi) / rest.shape[1]
    return np.asarray(np.sqrt(_power(rest) / max(len(rest) - used, 1.0)))


def sums_of_groups(values: Array, group: Integers) -> Array:
    """Sums of values (N, ...) by the number of their group, (groups, ...)."""
    columns = values.reshape(len(values), -1).T
    sums = np.stack([np.bincount(group, column) for column in columns], axis=1)
    return np.asarray(sums.reshape(-1, *values.shape[1:]))


def weights_from(sigma: Array, tau: Array) -> Array:
    """Weights w_j = 1/s_j², (n,), with s_j kept above rounding so that w_j stays finite."""
    largest = float(np.sqrt(np.mean(tau**2, axis=0)).max())
    return 1 / np.maximum(sigma, SILENT * max(largest, 1e-300)) ** 2


def autocorrelation(rest: Array) -> Array:
    """Autocorrelation ρ_l of the residuals of each joint: rest (N, n) → (LAGS, n)."""
    out = np.zeros((LAGS, rest.shape[1]))
    for j, row in enumerate(np.ascontiguousarray(rest.T)):
        centred = row - row.mean()
        power = centred @ centred
        if power > 0:
            out[:, j] = [centred[k:] @ centred[:-k] / power for k in range(1, LAGS + 1)]
    return out


def inflation(rest: Array, weights: Array) -> float:
    """Variance inflation N / N_eff = 1 + 2 Σ ρ_l of all joints together (Bartlett 1946)."""
    power = weights * _power(rest - rest.mean(axis=0))
    if not power.sum() > 0:
        return 1.0
    return max(1.0, float(1 + 2 * (autocorrelation(rest).sum(axis=0) @ power) / power.sum()))


def _power(rest: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->j", rest, rest))
