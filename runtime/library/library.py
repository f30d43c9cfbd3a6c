"""One typed NumPy method per kernel of a generated robot."""

import ctypes
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import LibraryError, NotRealisableError, ShapeError
from runtime.library.binding import Array, Binding
from runtime.library.closed_loop import CompiledLoop, LoopBody, LoopLaw
from runtime.library.descent import AdamProblem, CompiledAdam, CompiledLevenberg, LeastSquares
from runtime.library.excitation import CompiledExcitation, ExcitationFunctions
from runtime.library.manifest import PI_NAMES, read_manifest
from runtime.library.statistics import CompiledStatistics

_SIZE = len(PI_NAMES)


class Library:
    """The physics of one robot, compiled; every method takes one sample or N.

    n joints, one body each, n_b base parameters. π and λ of all links are flat, link by link.
    `pi0` and `lam0` are those of the URDF.
    """

    def __init__(self, folder: Path, level: str | None = None, threads: int | None = None) -> None:
        self.folder = folder
        self.manifest = read_manifest(folder / "manifest.json")
        self._binding = Binding(folder, self.manifest, level, threads)
        self.level, self.levels = self._binding.level, self._binding.levels
        job = (ctypes.c_void_p, ctypes.c_long, ctypes.c_long)
        self._adam = self._binding.function("adam", *job)
        self._levenberg = self._binding.function("levenberg", *job)
        m = self.manifest
        self.compiled_statistics = (
            CompiledStatistics(self._binding.own, len(m.joints), len(m.base_columns))
            if self._binding.own("statistics") is not None
            else None
        )
        """The statistics of this level in C; None where the library has none."""
        self.name = m.robot
        self.joint_names = tuple(j.name for j in m.joints)
        self.link_names = tuple(j.link for j in m.joints)
        self.n_joints = len(m.joints)
        self.pi0: Array = np.array(m.pi0)
        self.lam0: Array = np.array(m.lam0)
        self.base_matrix: Array = np.array(m.base_matrix)
        """K in β = K π, (n_b, 10 n)."""
        self.base_columns = m.base_columns
        """Indices into π; Y_b = Y[:, base_columns]."""
        self.home: Array = np.array(m.home)
        self.gravity: Array = np.array(m.gravity)

    def __repr__(self) -> str:
        sizes = f"{self.n_joints} joints, {len(self.base_columns)} base parameters"
        return f"Library({self.name!r}, {sizes})"

    def limits(self) -> dict[str, Array]:
        """lower, upper, velocity, effort, acceleration and jerk per joint, ±inf where unlimited."""
        m, inf = self.manifest, np.inf

        def column(key: str, missing: float) -> Array:
            values = [getattr(j, key) for j in m.joints]
            return np.array([missing if v is None else v for v in values], dtype=float)

        free = (inf,) * self.n_joints
        return {
            "lower": column("lower", -inf),
            "upper": column("upper", inf),
            "velocity": column("velocity", inf),
            "effort": column("effort", inf),
            "acceleration": np.array(m.acceleration or free),
            "jerk": np.array(m.jerk or free),
        }

    def urdf(self) -> str:
        """The URDF that the kernels describe, as symgen normalised it."""
        path = self.folder / f"{self.name}.urdf"
        try:
            return path.read_text(encoding="utf-8")
        except OSError:
            raise LibraryError(f"'{path}' is missing; run: python -m symgen build") from None

    # --- motion: q, dq, ddq are (N, n) or (n,) ---------------------------------------------

    def inverse_dynamics(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, pi: ArrayLike) -> Array:
        """τ = Y(q, dq, ddq) π, (N, n) [N·m or N]. Source: Eq. 4.3."""
        return self._binding.call("inverse_dynamics", q, dq, ddq, pi)[0]

    def base_inverse_dynamics(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, beta: ArrayLike
    ) -> Array:
        """τ = Y_b(q, dq, ddq) β, (N, n) [N·m or N]. Source: Eq. 3.11."""
        return self._binding.call("base_inverse_dynamics", q, dq, ddq, beta)[0]

    def torque(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, lam: ArrayLike) -> Array:
        """τ = Y(q, dq, ddq) π(λ), (N, n). Source: Eqs. 4.3, 4.14."""
        return self._binding.call("torque", q, dq, ddq, lam)[0]

    def torque_jacobian(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, lam: ArrayLike) -> Array:
        """∂τ/∂λ, (N, n, 10 n). Source: Eqs. 4.34–4.36."""
        return self._binding.call("torque_jacobian", q, dq, ddq, lam)[0]

    def regressor(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Y with τ = Y π, (N, n, 10 n). Source: Eq. 3.1."""
        return self._binding.call("regressor", q, dq, ddq)[0]

    def base_regressor(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Y_b with τ = Y_b β, (N, n, n_b). Source: Eq. 3.11."""
        return self._binding.call("base_regressor", q, dq, ddq)[0]

    def mass_matrix(self, q: ArrayLike, pi: ArrayLike) -> Array:
        """M(q), (N, n, n). Source: Eq. 2.34."""
        return self._binding.call("mass_matrix", q, pi)[0]

    def bias_forces(self, q: ArrayLike, dq: ArrayLike, pi: ArrayLike) -> Array:
        """h = τ(q, dq, 0), (N, n). Source: Eq. 2.34."""
        return self._binding.call("bias_forces", q, dq, pi)[0]

    def forward_dynamics(
        self, q: ArrayLike, dq: ArrayLike, tau: ArrayLike, pi: ArrayLike, rotor: ArrayLike = 0.0
    ) -> Array:
        """ddq = (M + diag(J))⁻¹ (τ − h), (N, n); J (n,) or one number: reflected rotor inertia."""
        inertia = np.broadcast_to(np.asarray(rotor, dtype=float), (self.n_joints,))
        return self._binding.call("forward_dynamics", q, dq, tau, pi, inertia)[0]

    def end_effector(self, q: ArrayLike) -> Array:
        """Pose of the tip in the base frame, (N, 4, 4)."""
        return self._binding.call("end_effector", q)[0]

    def loss_gradient(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        tau: ArrayLike,
        weight: ArrayLike,
        pi: ArrayLike,
    ) -> tuple[float, Array, Array]:
        """Σ ½ rᵀWr, Σ YᵀWr (10 n,) and r = Yπ − τ (N, n) over the batch; W = diag(weight).

        Source: Eqs. 4.5, 4.6, 4.32.
        """
        beta = np.asarray(pi, dtype=float) @ self.base_matrix.T
        answer = self._binding.call("loss_gradient", q, dq, ddq, tau, weight, beta)
        loss, gradient, residual = answer
        return float(loss[0]), gradient @ self.base_matrix, residual

    def regressor_adjoint(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, seed: ArrayLike
    ) -> Array:
        """∂⟨seed, Y_b⟩/∂(q, dq, ddq), (N, 3, n), from seed (N, n, n_b)."""
        return self._binding.call("regressor_adjoint", q, dq, ddq, seed)[0]

    # --- descents in x = [λ, ψ], see `runtime.descent` ---------------------------------------

    @property
    def descends(self) -> bool:
        """This level holds the loops of `adam` and `levenberg`."""
        return self._adam is not None

    def adam(
        self, problems: Sequence[AdamProblem], options: dict[str, float], traces: int, batch: int
    ) -> CompiledAdam:
        """Compiled descents by Adam; LibraryError where this level has none."""
        return CompiledAdam(self._needed(self._adam), problems, options, traces, batch)

    def levenberg(
        self,
        starts: Sequence[Array],
        problems: Sequence[LeastSquares],
        options: dict[str, float],
        traces: int,
    ) -> CompiledLevenberg:
        """Compiled descents by Levenberg–Marquardt; LibraryError where this level has none."""
        return CompiledLevenberg(self._needed(self._levenberg), starts, problems, options, traces)

    def _needed(self, function: Callable[..., None] | None) -> Callable[..., None]:
        if function is None:
            raise LibraryError(f"the level '{self.level}' of '{self.name}' has no compiled descent")
        return function

    def excitation_cost(self, home: Array, basis: Array) -> CompiledExcitation | None:
        """log cond W̄_b and its gradient in C, see `runtime.excitation`; None without at this level.

        Args:
            home: (n,) rad or m.
            basis: φ, φ', φ'' at the samples, (N, M, 3).
        """
        found = self._binding.excitation()
        return CompiledExcitation(ExcitationFunctions(*found), home, basis) if found else None

    def closed_loop(
        self, body: LoopBody, law: LoopLaw, reference: Array, period: float, **options: Any
    ) -> CompiledLoop:
        """The robot under computed torque in C, see `CompiledLoop` and `runtime.simulation`."""
        function = self._binding.common("closed_loop", ctypes.c_void_p, ctypes.c_long)
        return CompiledLoop(function, body, law, reference, period, **options)

    # --- trajectories: one row per point ----------------------------------------------------

    def harmonic_basis(self, m: ArrayLike, t: ArrayLike, t_f: float) -> Array:
        """φ_m(t) of the Fourier + quintic basis and three derivatives, (N, 4). Eqs. 3.24–3.27."""
        orders, times = np.broadcast_arrays(np.atleast_1d(m), np.atleast_1d(t))
        return self._binding.call("harmonic_basis", _column(orders), _column(times), t_f)[0]

    def transfer_basis(self, t: ArrayLike, t_f: float) -> Array:
        """S(t), the rest-to-rest quintic from 0 to 1, and three derivatives, (N, 4)."""
        return self._binding.call("transfer_basis", _column(t), t_f)[0]

    # --- bodies: π and λ are (10 n,), or (N, 10 n) ------------------------------------------

    def pi_from_lam(self, lam: ArrayLike) -> Array:
        """π of every link from λ. Source: Eqs. 4.25–4.31."""
        flat = self._links("lam", lam)
        return self._binding.call("pi_from_lam", flat)[0].reshape(np.shape(lam))

    def pi_jacobian(self, lam: ArrayLike) -> Array:
        """∂π_k/∂λ_k, (n, 10, 10) or (N, n, 10, 10)."""
        blocks = self._binding.call("pi_jacobian", self._links("lam", lam))[1]
        return blocks.reshape(*np.shape(lam)[:-1], self.n_joints, _SIZE, _SIZE)

    def pi_adjoint(self, lam: ArrayLike, slope: ArrayLike) -> Array:
        """(∂π/∂λ)ᵀ slope, link by link: ∂cost/∂λ (10 n,) from ∂cost/∂π. Source: Eq. 4.32."""
        links = self._links("lam", lam), self._links("slope", slope)
        return self._binding.call("pi_adjoint", *links)[0].reshape(np.shape(lam))

    def lam_from_pi(self, pi: ArrayLike) -> Array:
        """λ of every link from π, a ≥ b ≥ c. Source: Eqs. 4.18–4.23.

        Raises:
            NotRealisableError: a link is no body that can exist; `nearest_realisable` repairs it.
        """
        flat = self._links("pi", pi)
        lam = self._binding.call("lam_from_pi", flat)[0]
        bad = np.flatnonzero(~np.isfinite(lam).all(axis=1))
        if bad.size:
            links = ", ".join(dict.fromkeys(self.link_names[k % self.n_joints] for k in bad))
            worst = self.relative_eigenvalues(flat[bad[0]])[0]
            raise NotRealisableError(
                f"pi of {links} belongs to no body of positive density (smallest eigenvalue of "
                f"the pseudo-inertia {worst:.2e} of its trace); take nearest_realisable(pi) to "
                "continue with the closest body that exists"
            )
        return lam.reshape(np.shape(pi))

    def nearest_realisable(self, pi: ArrayLike, floor: float = 1e-4) -> Array:
        """π with each Σ_com moved to the nearest one with eigenvalues ≥ floor · tr; m, c kept."""
        flat = self._links("pi", pi)
        return self._binding.call("nearest_realisable", flat, floor)[0].reshape(np.shape(pi))

    def inertia_matrix(self, lam: ArrayLike) -> Array:
        """M_k(λ_k), (n, 6, 6), linear part first. Source: Eq. 4.14."""
        blocks = self._binding.call("inertia_matrix", self._links("lam", lam))[0]
        return blocks.reshape(*np.shape(lam)[:-1], self.n_joints, 6, 6)

    def pseudo_inertia(self, pi: ArrayLike) -> Array:
        """P_k(π_k), (n, 4, 4). Source: Eqs. 3.9, 3.10."""
        blocks = self._binding.call("pseudo_inertia", self._links("pi", pi))[0]
        return blocks.reshape(*np.shape(pi)[:-1], self.n_joints, 4, 4)

    def relative_eigenvalues(self, pi: ArrayLike) -> Array:
        """Smallest eigenvalue of each P_k over its trace: positive means strictly consistent.

        NaN where π is not finite.
        """
        blocks = self._binding.call("pseudo_inertia", np.reshape(pi, (-1, _SIZE)))[0]
        finite = np.isfinite(blocks).all(axis=(1, 2))
        smallest = np.full(len(blocks), np.nan)
        smallest[finite] = np.linalg.eigvalsh(blocks[finite])[:, 0]
        traces = np.trace(blocks, axis1=1, axis2=2)
        return smallest / np.where(traces == 0, 1.0, np.abs(traces))

    def _links(self, name: str, value: ArrayLike) -> Array:
        """(10 n,) or (N, 10 n) as rows of one link each."""
        array = np.asarray(value, dtype=float)
        if array.ndim not in {1, 2} or array.shape[-1] != _SIZE * self.n_joints:
            width = _SIZE * self.n_joints
            raise ShapeError(
                f"{name} needs the shape ({width},) or (N, {width}), got {array.shape}"
            )
        return array.reshape(-1, _SIZE)


def _column(value: ArrayLike) -> Array:
    return np.reshape(np.asarray(value, dtype=float), (-1, 1))
