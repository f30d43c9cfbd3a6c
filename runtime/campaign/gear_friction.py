"""Friction of geared joints with a memory, as columns of the logs of a campaign.

    f = ζ (φ₁ + φ₂ s + φ₃ exp(−(dq/v_s)²) + φ₄ |τ|) + φ₅ dq + φ₆ sin(w q) + φ₇ cos(w q) + φ₈

ζ is Dahl's state with the stroke z_c, s the smooth sign of dq, |τ| the measured torque, and w the
number of waves of the gear per rad. Columns tanh(dq/ε), which have no memory, leave a pattern after
every reversal; on the virtual FR3 it moves the predicted torque by 0.15 N·m. z_c, v_s, w and the
delay of the torque differ between joints and are estimated (`gear_search`).
Source: Armstrong-Hélouvry 1994 (Stribeck), Dahl 1976, Hamon et al. 2010 (load).
"""

from dataclasses import dataclass, replace

import numpy as np

from runtime.library import Array, Library
from runtime.recording import Preparation, Recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction import OFFSET, dahl_state
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.derivatives import differentiate
from runtime.recording.preprocessing.filters import low_pass

MOTION_HZ, BELOW_RATE = 60.0, 0.4
"""Cut-off of q before it is differentiated [Hz], and the same over the rate of a slow log: measured
speeds pass a filter of the robot, which delays them by more than a millisecond."""
SIGN_SPEED = 5e-3
"""Width of s [rad/s, m/s], above the noise of the differentiated position."""
FRICTION = (
    *("dahl", "dahl asymmetric", "dahl stribeck", "dahl load"),
    *("viscous", "ripple sine", "ripple cosine"),
)
MEMORY = 4
"""Number of columns with ζ, the first ones."""
ERRORS = ("delay error", "stroke error", "peak speed error", "waves error")
"""Columns whose coefficients are errors of the parameters that the others depend on."""
SPREAD = np.array([5e-3, 0.7, 0.7, 1.0])
"""σ of delay [s], ln z_c, ln v_s and w [1/rad], of joints whose motion hardly determines them."""
LOAD = 0.02
"""σ of friction over the load."""
NAMES = (*FRICTION, *ERRORS, OFFSET.name)
"""All columns; the offset, the last one, is one per log."""
STROKE, PEAK_SPEED = 2e-3, 0.1
"""z_c and v_s before they are estimated [rad, rad/s]."""
STEP = 0.1
"""Step of ln z_c in the difference quotient of the columns."""


@dataclass(frozen=True, slots=True, eq=False)
class GearFriction:
    """What the columns depend on, (n,) each.

    Attributes:
        delay: the log stamps τ this much later than q [s].
        stroke: z_c [rad, m].
        peak_speed: v_s [rad/s, m/s].
        waves: w [1/rad, 1/m]; 0 for a joint without a ripple.
        phi: coefficients of `FRICTION`, (n, 7), from which errors of the others become torques.
    """

    delay: Array
    stroke: Array
    peak_speed: Array
    waves: Array
    phi: Array

    @classmethod
    def usual(cls, n: int) -> "GearFriction":
        """Values before anything is estimated, of n joints."""
        zero = np.zeros(n)
        return cls(zero, zero + STROKE, zero + PEAK_SPEED, zero, np.zeros((n, len(FRICTION))))

    def facts(self) -> dict[str, list[float]]:
        """JSON-ready content."""
        return {
            "torque_delay_s": self.delay.tolist(),
            "stroke": self.stroke.tolist(),
            "peak_speed": self.peak_speed.tolist(),
            "waves": self.waves.tolist(),
        }


def smoothed(recording: Recording, lib: Library) -> Recording:
    """The log with dq and ddq of the low-passed q, zero-phase."""
    bare = independent_joints(recording, lib).replace(dq=None, ddq=None)
    cutoff = min(MOTION_HZ, BELOW_RATE * recording.rate_hz)
    return differentiate(low_pass(bare, cutoff, only=("q",)))


def prepared_log(motion: Recording, gear: GearFriction, preparation: Preparation) -> Recording:
    """Rows of a log with the columns of `NAMES`."""
    friction, slopes, rows = prepared_columns(motion, gear, preparation)
    columns = (friction, errors_of(slopes, gear.phi), np.ones((*friction.shape[:2], 1)))
    return rows.replace(columns=np.concatenate(columns, axis=2), column_names=NAMES)


def prepared_columns(
    motion: Recording, gear: GearFriction, preparation: Preparation
) -> tuple[Array, Array, Recording]:
    """Columns of friction and their derivatives, at the rows of a prepared log."""
    columns = friction_columns(motion, gear)
    both = np.concatenate([columns, slope_columns(motion, gear, columns)], axis=2)
    names = tuple(f"column {k}" for k in range(both.shape[2]))
    steps = replace(preparation, torque_delay_s=tuple(gear.delay.tolist()))
    rows = prepare(motion.replace(columns=both, column_names=names), steps)
    done = np.asarray(rows.columns)
    return done[..., : len(FRICTION)], done[..., len(FRICTION) :], rows


def errors_of(slopes: Array, phi: Array) -> Array:
    """Torque per error of delay, ln z_c, ln v_s and w.

    slopes (N, n, 8), phi (n, 7) → (N, n, 4).
    """
    return np.stack(
        [
            -slopes[..., 7],
            np.einsum("tjm,jm->tj", slopes[..., :MEMORY], phi[:, :MEMORY]),
            slopes[..., 4] * phi[:, 2],
            slopes[..., 5] * phi[:, 5] + slopes[..., 6] * phi[:, 6],
        ],
        axis=2,
    )


def friction_columns(motion: Recording, gear: GearFriction) -> Array:
    """Columns of a log at its full rate.

    motion (N, n) → (N, n, 7).
    """
    dq = motion.required("dq")
    angle = gear.waves * motion.q
    others = (dq, np.sin(angle), np.where(gear.waves > 0, np.cos(angle), 0.0))
    return np.concatenate(
        [_with_memory(motion, gear, gear.stroke), np.stack(others, axis=2)], axis=2
    )


def slope_columns(motion: Recording, gear: GearFriction, columns: Array) -> Array:
    """Derivatives of the columns by the parameters of the gear.

    motion (N, n) → (N, n, 8).
    """
    further = _with_memory(motion, gear, gear.stroke * np.exp(STEP))
    by_stroke = (further - columns[..., :MEMORY]) / STEP
    ratio = (motion.required("dq") / gear.peak_speed) ** 2
    by_speed = 2 * ratio * columns[..., 2]
    turning = np.where(gear.waves > 0, motion.q, 0.0)
    by_waves = (turning * columns[..., 6], -turning * columns[..., 5])
    rate = np.gradient(motion.required("tau"), motion.t, axis=0)
    return np.concatenate([by_stroke, np.stack([by_speed, *by_waves, rate], axis=2)], axis=2)


def _with_memory(motion: Recording, gear: GearFriction, stroke: Array) -> Array:
    """The columns with ζ, (N, n, 4)."""
    dq = motion.required("dq")
    zeta = dahl_state(motion.q, stroke)
    factors = (
        *(np.ones_like(dq), np.tanh(dq / SIGN_SPEED), np.exp(-((dq / gear.peak_speed) ** 2))),
        np.abs(motion.required("tau")),
    )
    return zeta[..., None] * np.stack(factors, axis=2)
