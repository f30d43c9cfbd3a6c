"""A motion at samples, with torques and tip velocities computed once for all constraints."""

import numpy as np

from runtime.library import Array, Library


class SampledMotion:
    """A motion with five derivatives, q first, at N samples, (5, N, n)."""

    def __init__(self, lib: Library, motion: Array) -> None:
        self.lib, self.motion = lib, motion
        self._torques: dict[bytes, tuple[Array, Array, Array]] = {}
        self._tip: tuple[Array, Array, Array] | None = None

    def torques(self, pi: Array) -> tuple[Array, Array, Array]:
        """Torques τ and their rates dτ/dt and d²τ/dt², (N, n), under parameters π (10 n,)."""
        key = pi.tobytes()
        if key not in self._torques:
            q, dq, ddq, dddq, ddddq = self.motion
            self._torques[key] = self.lib.torque_with_rates(q, dq, ddq, dddq, ddddq, pi)
        return self._torques[key]

    def tip(self) -> tuple[Array, Array, Array]:
        """Place, velocity and acceleration of the tip, (N, 3) m, m/s and m/s²."""
        if self._tip is None:
            q, dq, ddq = self.motion[:3]
            p, v, dp_dq, dv_dq = self.lib.tip_motion(q, dq)
            self._tip = p, v, times(dv_dq, dq) + times(dp_dq, ddq)
        return self._tip


def times(jacobian: Array, speed: Array) -> Array:
    """Product J ẋ at every sample.

    jacobian (N, R, n), speed (N, n) → (N, R).
    """
    return np.asarray(np.matmul(jacobian, speed[:, :, None])[:, :, 0])
