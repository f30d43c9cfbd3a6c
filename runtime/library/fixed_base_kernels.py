"""Typed methods of kernels for robots with a fixed base: momentum, energy, springs, trajectories.

The library of a robot with a free base answers a call with the name of what to use instead.
"""

import numpy as np
from numpy.typing import ArrayLike

from runtime.library.binding import Array, Binding
from runtime.library.manifest import Manifest


class FixedBaseKernels:
    """Equations without accelerations, springs, and bases of trajectories of one robot."""

    manifest: Manifest
    _binding: Binding

    def momentum_regressor(self, q: ArrayLike, dq: ArrayLike) -> tuple[Array, Array]:
        """Regressors of the momentum p = M dq = P_b β and of ∂(T − U)/∂q = R_b β, τ = dp/dt − R_b
        β.

        Source: Slotine & Li 1987.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].

        Returns:
            P_b and R_b, (N, n, n_b) each.
        """
        momentum, force = self._binding.call("momentum_regressor", q, dq)
        return momentum, force

    def energy_regressor(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """Regressor E_b of the energy T + U = E_b β + const. Source: Gautier & Khalil 1988.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].

        Returns:
            (N, n_b).
        """
        return self._binding.call("energy_regressor", q, dq)[0]

    def spring_columns(self, q: ArrayLike) -> Array:
        """Torques S(q) of the springs of unknown stiffness for k = 1, τ = S k.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].

        Returns:
            (N, n, s) for the s springs of `manifest.springs`; s = 0 without springs.
        """
        if "spring_columns" not in self.manifest.kernels:
            return np.zeros((*np.shape(q), 0))
        return self._binding.call("spring_columns", q)[0]

    def known_torque(self, q: ArrayLike) -> Array:
        """Torques of torque curves and of springs of known stiffness, which Y π lacks.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].

        Returns:
            Shape of q [N·m, N]; zeros without such.
        """
        if "known_torque" not in self.manifest.kernels:
            return np.zeros(np.shape(q))
        return self._binding.call("known_torque", q)[0]

    def regressor_adjoint(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, seed: ArrayLike
    ) -> Array:
        """Derivative ∂⟨seed, Y_b⟩/∂(q, dq, ddq).

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            seed: (N, n, n_b).

        Returns:
            (N, 3, n).
        """
        return self._binding.call("regressor_adjoint", q, dq, ddq, seed)[0]

    # --- trajectories: one row per point ----------------------------------------------------

    def harmonic_basis(self, m: ArrayLike, t: ArrayLike, t_f: float) -> Array:
        """Fourier + quintic basis φ_m(t) and three derivatives. Source: Eqs. 3.24–3.27.

        Args:
            m: harmonic, one number or (N,).
            t: times, one number or (N,) [s].
            t_f: duration [s].

        Returns:
            (N, 4).
        """
        orders, times = np.broadcast_arrays(np.atleast_1d(m), np.atleast_1d(t))
        return self._binding.call("harmonic_basis", _column(orders), _column(times), t_f)[0]

    def transfer_basis(self, t: ArrayLike, t_f: float) -> Array:
        """Rest-to-rest quintic S(t) from 0 to 1, and three derivatives.

        Args:
            t: times, one number or (N,) [s].
            t_f: duration [s].

        Returns:
            (N, 4).
        """
        return self._binding.call("transfer_basis", _column(t), t_f)[0]


def _column(value: ArrayLike) -> Array:
    return np.reshape(np.asarray(value, dtype=float), (-1, 1))
