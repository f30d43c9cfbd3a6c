"""Momentum balance of an identified model, rotors and friction included.

    τ_m + τ_ext = dp/dt − s,   p = M dq + J_r dq,   s = ∂(T − U)/∂q − τ_f = Cᵀ dq − g − τ_f

p and Cᵀ dq − g come from the regressors of `momentum_regressor`; columns of rotor inertia count in
p, all others in τ_f. No acceleration is needed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from runtime.identification.identified import Identification
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library, Mask
from runtime.recording import Friction, Preparation
from runtime.recording.friction.coupled_motors import Coupling, coupling_of_terms, spread
from runtime.recording.friction.model import columns as friction_columns
from runtime.recording.friction.model import torque as friction_torque
from runtime.recording.settings import COLUMNS, FrictionColumn, JointMotion

CHUNK = 4096  # states whose regressors are held at a time
SLOW = 2.0  # speed in units of ε below which dry friction may act in either direction


@dataclass(frozen=True, slots=True)
class MonitoredModel:
    """Parameters that an observer computes with."""

    beta: Array  # base parameters β, (n_b,)
    terms: Friction  # friction columns, with the gear of coupled motors
    phi: Array  # friction coefficients, (n, k)
    preparation: Preparation  # of the log that the model was identified from

    @property
    def delay_s(self) -> float:
        """Delay of τ behind q in the log, the mean of the joints' [s]."""
        return float(np.mean(self.preparation.torque_delay_s or 0.0))

    def _are(self, is_such: Callable[[FrictionColumn], bool]) -> Mask:
        """Whether each friction column is of a kind, (k,)."""
        return np.array([is_such(COLUMNS[name]) for name in self.terms.columns], dtype=bool)

    @property
    def inertial(self) -> Mask:
        """Whether each friction column is an inertia, (k,)."""
        return self._are(lambda column: column.is_inertial)

    @property
    def coupling(self) -> Coupling | None:
        """Coupled motors of the columns; None without."""
        return coupling_of_terms(self.terms)

    def balance(self, lib: Library, motion: JointMotion) -> tuple[Array, Array]:
        """Momentum p and force s of τ_m + τ_ext = dp/dt − s, (N, n)."""
        q, dq = np.asarray(motion.q), motion.dq
        momentum, force = np.empty_like(q), np.empty_like(q)
        for start in range(0, len(q), CHUNK):
            part = slice(start, start + CHUNK)
            over_p, over_s = lib.momentum_regressor(q[part], dq[part])
            momentum[part], force[part] = over_p @ self.beta, over_s @ self.beta
        rotors, columns = self.columns(motion)
        momentum += friction_torque(rotors, self.phi, self.coupling)
        force -= friction_torque(columns, self.phi, self.coupling) + lib.known_torque(q)
        return momentum, force

    def rows(self, lib: Library, motion: JointMotion) -> tuple[Array, Array]:
        """Regressors of p and s over [β; φ]; friction with a memory counts as Coulomb friction."""
        over_p, over_s = lib.momentum_regressor(np.asarray(motion.q), motion.dq)
        sign = np.tanh(motion.dq / self.terms.coulomb_speed)
        rotors, columns = self.columns(replace(motion, zeta=sign))
        return (
            np.concatenate([over_p, spread(rotors, self.coupling)], axis=2),
            np.concatenate([over_s, -spread(columns, self.coupling)], axis=2),
        )

    def columns(self, motion: JointMotion) -> tuple[Array, Array]:
        """Friction columns of p and of τ_f, (N, n, k), at the speeds of a motion."""
        inertial, still = self.inertial, np.zeros_like(motion.dq)
        plain = friction_columns(replace(motion, ddq=still), self.terms)
        if not inertial.any():
            return np.zeros_like(plain), plain
        moving = friction_columns(replace(motion, dq=still, ddq=motion.dq), self.terms)
        return np.where(inertial, moving, 0.0), np.where(inertial, 0.0, plain)

    def session_features(self, motion: JointMotion) -> Array:
        """1, viscous and dry friction of the model: what a session scales, (N, n, 3)."""
        _, columns = self.columns(motion)
        is_viscous = self._are(lambda column: column.model_term == "damping")
        # Whatever follows the sign of the speed, or has a memory.
        is_dry = self._are(lambda column: "coulomb_speed" in column.widths) | self.memory
        parts = [
            friction_torque(columns, self.phi * kind, self.coupling)
            for kind in (is_viscous, is_dry)
        ]
        return np.stack([np.ones_like(motion.dq), *parts], axis=2)

    @property
    def memory(self) -> Mask:
        """Whether each friction column has a memory, (k,)."""
        lasts = self._are(lambda column: column.has_memory)
        return (lasts | self._are(lambda column: column.takes_memory)) & lasts.any()

    @property
    def lasting_friction(self) -> Array:
        """Size of the friction with a memory of every joint, (n,) [N·m, N]."""
        return np.asarray(np.abs(self.phi[:, self.memory]).sum(axis=1))

    def unknown_state(self, travel: Array) -> Array:
        """Largest error of the friction with a memory, whose first state is unknown."""
        return np.asarray(self.lasting_friction * np.exp(-travel / self.terms.dahl_stroke))

    @property
    def dry_friction(self) -> Array:
        """Dry friction of every joint by the sign of its speed, Σ |φ|, (n,) [N·m, N]."""
        dry = self._are(lambda c: c.model_term == "friction" and not c.has_memory)
        return np.asarray(np.abs(self.phi[:, dry]).sum(axis=1))

    def is_slow(self, dq: Array) -> Mask:
        """Joints so slow that the smooth sign of dq does not give the direction of friction."""
        return (np.abs(dq) < SLOW * self.terms.coulomb_speed) & (self.dry_friction > 0)


AnyModel = Identification | SavedResult | MonitoredModel  # what an observer takes as its model


def urdf_model(lib: Library) -> MonitoredModel:
    """The bodies of the URDF without friction."""
    n = lib.n_joints
    return MonitoredModel(lib.base_matrix @ lib.pi0, Friction(()), np.zeros((n, 0)), Preparation())


def model_of(identified: AnyModel, lib: Library) -> MonitoredModel:
    """The model of an identification or of a saved result."""
    if isinstance(identified, MonitoredModel):
        return identified
    phi = identified.usual_phi
    return MonitoredModel(
        beta=lib.base_matrix @ identified.pi,
        terms=identified.friction if phi.size else Friction(()),
        phi=phi.reshape(lib.n_joints, -1),
        preparation=identified.preparation,
    )
