"""Typed methods of the kernels that bound torques, tip and links on intervals of a motion."""

from numpy.typing import ArrayLike

from runtime.library.binding import Array, Binding
from runtime.library.manifest import Manifest


class ProofKernels:
    """Suprema over K intervals from those of the joints; units are those of SI."""

    manifest: Manifest
    _binding: Binding

    @property
    def bounds_motions(self) -> bool:
        """Whether the robot has these kernels; robots with closed loops have none."""
        return "torque_bounds" in self.manifest.kernels

    def torque_bounds(self, motion: ArrayLike, pi: ArrayLike) -> Array:
        """Bounds of |τ|, |dτ/dt|, |d²τ/dt²| and |d³τ/dt³| on intervals.

        Args:
            motion: bounds of |q| and five derivatives in time, (K, 6, n) [rad, m, and per s …].
            pi: (10 L,) inertial parameters of the links.

        Returns:
            (K, 4, n) [N·m, N, and per s …].
        """
        return self._binding.call("torque_bounds", motion, pi)[0]

    def tip_bounds(self, motion: ArrayLike) -> Array:
        """Bounds of the distance of the tip from the base and three derivatives of its place.

        Args:
            motion: bounds of |q| and three derivatives in time, (K, 4, n) [rad, m, and per s …].

        Returns:
            (K, 4) [m, m/s, m/s², m/s³].
        """
        return self._binding.call("tip_bounds", motion)[0]

    def speed_bounds(self, motion: ArrayLike) -> tuple[Array, Array]:
        """Bounds of the speed that joint j gives to link i: its origin, and turning about it.

        A point of the link at a distance r from its origin gets origin + r · turn at most.

        Args:
            motion: bounds of |q| and |dq|, (K, 2, n) [rad, m, and per s].

        Returns:
            (K, L, L) [m/s], 0 where joint j does not move link i, and (K, L) [rad/s].
        """
        origin, turn = self._binding.call("speed_bounds", motion)
        return origin, turn
