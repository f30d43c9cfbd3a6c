"""Plants whose joints follow others, by the compiled kernels in the independent joints.

    (M(q) + diag J + h D) (dq⁺ − dq) = h (τ − h(q, dq) − p(q) − D dq),   q⁺ = q + h dq⁺

M and the bias forces h(q, dq) are those of the mechanism, Gᵀ M_all G and so on; p are torques of
springs and curves of known stiffness, D the damping of the step. The step is MuJoCo's
("implicitfast"), the equations are those of the kernels, so that such a log does not check them.
"""

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import SimulationError
from runtime.library import Array, Library


class ReducedEngine:
    """State and step of a plant in the order of the library; for `mujoco_engine.Engine`."""

    def __init__(self, lib: Library, pi: Array, rotor: ArrayLike, step: float) -> None:
        """A plant at rest at q = 0."""
        lib.lam_from_pi(pi)  # raises
        n = lib.n_joints
        self.lib, self.pi, self.step_s = lib, pi, step
        self.rotor = np.broadcast_to(np.asarray(rotor, dtype=float), (n,))
        self.q, self.dq = np.zeros(n), np.zeros(n)
        self.damping, self.applied = np.zeros(n), np.zeros(n)
        self.places: Array = np.array(range(n))
        self.name = "symgen kernels"

    def sorted(self, values: Array) -> Array:
        """Values (…, n) as they are."""
        return np.ascontiguousarray(values)

    def restored(self, values: Array) -> Array:
        """Values (…, n) as they are."""
        return np.ascontiguousarray(values)

    def advance(self) -> None:
        """Move the state by one step under the applied torques and the damping."""
        lib, h = self.lib, self.step_s
        lib.require_closed(self.q)
        inertia = self._mass(self.q) + np.diag(h * self.damping)
        bias = lib.bias_forces(self.q, self.dq, self.pi) + lib.known_torque(self.q)
        force = self.applied - bias - self.damping * self.dq
        try:
            self.dq += h * np.linalg.solve(inertia, force)
        except np.linalg.LinAlgError:
            raise SimulationError(
                f"the mass matrix of '{lib.name}' is singular, so its motion is not determined; "
                "give every moving link a mass, or rotor inertias"
            ) from None
        self.q += h * self.dq

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torque of one state, rotors, springs and curves included.

        q (n,) [rad, m], dq (n,) [rad/s, m/s], ddq (n,) [rad/s², m/s²] → (n,) [N·m, N].
        """
        rigid = self.lib.inverse_dynamics(q, dq, ddq, self.pi)
        return np.asarray(rigid + self.rotor * ddq + self.lib.known_torque(q))

    def mass_diagonal(self, q: Array) -> Array:
        """Diagonal of M(q) + J.

        q (n,) [rad, m] → (n,) [kg·m², kg].
        """
        return np.array(np.diagonal(self._mass(q)))

    def _mass(self, q: Array) -> Array:
        n = self.lib.n_joints
        return np.reshape(self.lib.mass_matrix(q, self.pi), (n, n)) + np.diag(self.rotor)
