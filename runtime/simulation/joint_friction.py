"""Friction of a virtual joint: richer than the models that are fitted, and with a memory.

    f = c(dq) z + f_v dq + r f_c sin(w q + φ)
    c = f_c (1 ± a) + s f_c exp(−(dq/v_s)²) + k |τ|       + for dq > 0, − for dq < 0
    dz = (dq − |dq| z) dt / z_c                            Dahl's state, z ∈ [−1, 1]

f_c `coulomb`, a `asymmetry`, s `stribeck`, v_s `stribeck_speed`, f_v `viscous`, k `load` of the
torque τ behind the joint, r `ripple` with w `ripple_waves` per rad and φ `ripple_phase`, z_c
`dahl_stroke`. Source: Armstrong-Hélouvry 1994 (Stribeck), Dahl 1976, Hamon et al. 2010 (load).
"""

import numpy as np

from runtime.library import Array
from runtime.simulation.settings import VirtualFriction


class JointFriction:
    """The friction of all joints in time; z is its state."""

    def __init__(self, law: VirtualFriction, step: float, places: Array) -> None:
        """Friction from z = 0, in the order of the engine."""
        order = np.argsort(places)
        self.z = np.zeros(len(order))
        f_c = law.coulomb[order]
        self._forward, self._backward = (
            f_c * (1 + side * law.asymmetry[order]) for side in (1, -1)
        )
        self._peak = law.stribeck[order] * f_c
        self._sharpness = -1 / law.stribeck_speed[order] ** 2
        self._viscous, self._load = law.viscous[order], law.load[order]
        self._ripple = law.ripple[order] * f_c
        self._waves, self._phase = law.ripple_waves[order], law.ripple_phase[order]
        self._bend = step / law.dahl_stroke[order]

    def advance(self, q: Array, dq: Array, tau: Array) -> tuple[Array, Array]:
        """Friction torque of a step; moves the state z over it.

        z ← (z + h dq/z_c) / (1 + h |dq|/z_c) never leaves [−1, 1], however long the step.

        q (n,), dq (n,), tau (n,) → (n,).
        """
        travel = self._bend * dq
        way = 1 + np.abs(travel)
        z = (self.z + travel) / way
        level = np.where(dq > 0, self._forward, self._backward)
        level += self._peak * np.exp(self._sharpness * dq * dq)
        level += self._load * np.abs(tau)
        slope = self._viscous + level * self._bend * (1 - np.abs(z)) / way
        self.z = z
        f = level * z + self._viscous * dq + self._ripple * np.sin(self._waves * q + self._phase)
        return f, slope
