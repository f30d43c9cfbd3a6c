"""Motions of the experiments: designs of the excitation study, and sines of the document."""

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression.samples import Samples
from runtime.excitation import Trajectory, log_condition
from runtime.experiments.study import MOTION, Arrays
from runtime.library import Array, Library
from runtime.recording import Recording
from runtime.simulation import sample_times

ROBOT = "fr3"

LINK_7 = (
    *(1.2542865724, 5.6726134989e-3, 1.0819716922e-2, -2.0273441638e-2, 9.4286696773e-4),
    *(8.0771244614e-4, 3.3885162663e-4, -9.7599036040e-5, 1.8297790402e-4, 3.4976400656e-4),
)
"""π of link 7 [kg, kg·m, kg·m²]."""


def document_robot(lib: Library) -> Array:
    """Parameters π (70,) of the true robot [kg, kg·m, kg·m²]."""
    if lib.name != ROBOT:
        raise IdentificationError(
            f"expected the robot '{ROBOT}' of the document, got '{lib.name}'; "
            f"run: python -m symgen build {ROBOT}"
        )
    return np.concatenate([lib.pi0[: -len(LINK_7)], LINK_7])


PULSATION = 2.0
"""Angular frequency of Eq. 5.5 [rad/s]."""
ROLES = ("training", "validation", "test")
"""Roles of the three best designs, best first."""


def designed(lib: Library, needed: Arrays) -> list[Trajectory]:
    """Best designs in the order of `ROLES`."""
    duration = float(needed["duration"])
    return [Trajectory(lib.home, np.array(a), duration) for a in needed["coefficients"]]


def sinusoidal(
    lib: Library, duration: float, rate_hz: float, share: float, seed: int
) -> tuple[Recording, Array]:
    """Motion q = a + b sin(2t + φ) (Eqs. 5.5–5.7) and its amplitudes b.

    The document states neither a nor b: here a is the default pose and b a share of the largest
    amplitude within the limits of position, velocity and acceleration. φ ~ U(0, 2π) per joint.

    Returns (n,) [rad].
    """
    limits = lib.limits()
    room = np.minimum(limits["upper"] - lib.home, lib.home - limits["lower"])
    fast = np.minimum(limits["velocity"] / PULSATION, limits["acceleration"] / PULSATION**2)
    b = share * np.minimum(room, fast)
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, lib.n_joints)
    t = sample_times(duration, rate_hz)
    angle = PULSATION * t[:, None] + phase
    q, dq, ddq = (
        lib.home + b * np.sin(angle),
        PULSATION * b * np.cos(angle),
        -(PULSATION**2) * b * np.sin(angle),
    )
    sentence = f"Sines of {PULSATION:g} rad/s, {len(t)} samples at {rate_hz:g} Hz."
    recording = Recording(
        t, q, dq, ddq, name="sinusoidal", joint_names=lib.joint_names, history=(sentence,)
    )
    return recording, b


def condition(lib: Library, samples: Samples) -> float:
    """Condition number of the column-normalised base regressor of all samples."""
    rows = lib.base_regressor(samples.q, samples.dq, samples.ddq)
    return float(np.exp(log_condition(rows.reshape(-1, rows.shape[-1]))[0]))


def curves(prefix: str, recording: Recording) -> dict[str, Array]:
    """Series t, q, dq, ddq and tau of a recording."""
    named = {key: getattr(recording, key) for key in MOTION}
    return {f"{prefix}_{key}": value for key, value in named.items() if value is not None}
