"""Consistency of a recording in itself, s_j = median(Δq_j / ∫dq_j dt) ≈ 1, and with a robot.

A slope of 57.3 or 1/57.3 means degrees instead of radians, 1000 or 1/1000 milliseconds instead of
seconds, 1e-6 and 1e-9 microseconds and nanoseconds. Nothing is corrected: joint count, units and
signs are stated in a recipe and never guessed.
"""

from collections.abc import Mapping

import numpy as np

from runtime.errors import IdentificationError, RecordingError
from runtime.library import Array, Integers, Library
from runtime.library.manifest import common_unit, torque_units
from runtime.recording.recipes.default_convention import states_unread
from runtime.recording.recording import Recording

STRIDE = 5
ROWS = 4096  # rows whose steps are computed together
STILL = 1e-12  # largest ∫dq dt that counts as rest [rad, m]
USUAL_STEP = 0.5  # median step above which rows are no motion, but drawn at random [rad]
TIMES_USUAL, BESIDE_TURN = 20.0, (0.05, 0.5)
"""Largest distance of a jump from one turn, over the 99 % quantile of the steps of the joint, and
its bounds [rad]: a gap of some rows moves it further, a corrupt row lies anywhere."""
DEGREE = 180.0 / np.pi
NEAR = 0.15  # relative distance of a slope from that of a unit, below which it names the unit
FEWEST_SIGNED = 3  # joints with a varying torque, from which on one sign of all is none of gravity
UNITS_OF_TIME = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9, "s declared as ms": 1e3}  # slope by unit


def check_consistency(recording: Recording) -> Recording:
    """The recording, with a warning where Δq/Δt and dq differ; a factor of units is refused."""
    if len(recording) > 1 and not 2.0 <= recording.rate_hz <= 2e4:
        recording = recording.noted(
            f"Warning: a rate of {recording.rate_hz:.4g} Hz is unusual; check the unit of time."
        )
    reach = float(np.abs(recording.q).max())
    if reach > 8.0 * np.pi:
        recording = recording.noted(
            f"Warning: positions reach {reach:.4g}, more than four turns; check their unit."
        )
    if recording.dq is None or len(recording) <= 2 * STRIDE:
        return recording
    slopes = slopes_of(recording)
    looks = {
        "positions look like degrees": DEGREE,
        "velocities look like degrees per second": 1.0 / DEGREE,
        **{f"time looks like {unit}": factor for unit, factor in UNITS_OF_TIME.items()},
    }
    if pair := unit_of_slopes(slopes, looks):
        suspicion, joints = pair
        others = f" (and at {joints.size - 1} more)" if joints.size > 1 else ""
        raise RecordingError(
            f"{suspicion}: expected Δq/Δt equal to dq, but their ratio is "
            f"{slopes[joints[0]]:.4g} at joint {joints[0] + 1}{others}; state the unit in a recipe"
        )
    odd = np.flatnonzero(np.abs(slopes - 1.0) > 0.1)
    if odd.size:
        listed = ", ".join(f"{slopes[j]:.3g} at joint {j + 1}" for j in odd)
        recording = recording.noted(
            f"Warning: Δq/Δt over dq is {listed} instead of 1; check units, signs, order and clock."
        )
    return recording


def unwrap(q: Array) -> tuple[Array, Integers]:
    """Angles without jumps of one turn, and the number of jumps per joint.

    A step counts as a jump only if it is one turn to within what the joint moves in a step, at a
    joint whose steps are usually small; other steps, those to corrupt rows too, are kept.
    """
    # Some rows at a time, so that the steps of a long log stay in the cache.
    pieces = (q[first : first + ROWS + 1] for first in range(0, len(q) - 1, ROWS))
    largest = [np.abs(np.diff(piece, axis=0)).max(initial=0.0) for piece in pieces]
    if not largest or np.max(largest) < np.pi:
        return q, np.zeros(q.shape[1], dtype=np.int64)
    steps = np.diff(q, axis=0)
    turns = np.round(steps / (2.0 * np.pi))
    sizes = np.abs(steps)
    usual = TIMES_USUAL * np.quantile(sizes, 0.99, axis=0)
    rest = np.abs(steps - 2.0 * np.pi * turns)
    jump = (np.abs(turns) == 1.0) & (rest < np.clip(usual, *BESIDE_TURN))
    jump &= np.median(sizes, axis=0) < USUAL_STEP
    if not jump.any():
        return q, np.zeros(q.shape[1], dtype=np.int64)
    correction = np.zeros_like(q)
    correction[1:] = 2.0 * np.pi * np.cumsum(np.where(jump, turns, 0.0), axis=0)
    return q - correction, jump.sum(axis=0)


def slopes_of(recording: Recording) -> Array:
    """Robust ratio of Δq and ∫dq dt over 5 samples (n,); NaN for joints that hardly move."""
    # trapezoidal rule, ∫dq dt up to every sample
    step, speed = np.diff(recording.t)[:, None], recording.required("dq")
    areas = np.cumsum(step * (speed[1:] + speed[:-1]) / 2.0, axis=0)
    integral = np.concatenate([np.zeros((1, speed.shape[1])), areas])
    displaced = recording.q[STRIDE:] - recording.q[:-STRIDE]
    integrated = integral[STRIDE:] - integral[:-STRIDE]
    slopes = np.full(recording.n_joints, np.nan)
    for j in range(recording.n_joints):
        fast = np.abs(integrated[:, j]) >= np.quantile(np.abs(integrated[:, j]), 0.75)
        fast &= np.abs(integrated[:, j]) > STILL
        if not fast.any():
            continue
        ratio = displaced[fast, j] / integrated[fast, j]
        spread = np.quantile(ratio, 0.75) - np.quantile(ratio, 0.25)
        if spread < np.abs(middle := np.median(ratio)):
            slopes[j] = middle
    return slopes


def unit_of_slopes(slopes: Array, looks: Mapping[str, float]) -> tuple[str, Integers] | None:
    """First unit, by its factor, that some slopes are near to, and the joints of these."""
    for unit, factor in looks.items():
        joints = np.flatnonzero(np.abs(slopes / factor - 1.0) < NEAR)
        if joints.size:
            return unit, joints
    return None


BEYOND_LIMIT = 1.0  # distance beyond a limit from which unit, order or robot is wrong [rad, m]

LEAST_TORQUE = 1e-9  # largest torque below which nothing was measured or the unit is wrong [N·m, N]

LEAST_RATE = 2.0  # rate below which differences of positions do not determine the velocity [Hz]


def require_plausible(recording: Recording, lib: Library) -> None:
    """Require that a recording agrees with the model of the robot."""
    require_joints(recording, lib)
    if recording.tau is None:
        unread = [step for step in recording.history if states_unread(step)]
        raise IdentificationError(
            f"the recording '{recording.name}' has no torque, which identification needs"
            + "".join(f"; {step.removeprefix('Warning: ').rstrip('.')}" for step in unread)
        )
    largest = float(np.abs(recording.tau).max())
    if largest < LEAST_TORQUE:
        unit = common_unit(torque_units(lib.manifest))
        much = f"at most {largest:.2g} {unit}" if largest else "0 throughout"
        raise IdentificationError(
            f"the torque of the recording '{recording.name}' is {much}; log the measured one"
        )
    require_motion(recording, lib)
    _require_sign(recording, lib)


def require_motion(recording: Recording, lib: Library) -> None:
    """Require that the robot can make the motion."""
    require_joints(recording, lib)
    if recording.dq is None and len(recording) > 1 and recording.rate_hz < LEAST_RATE:
        raise IdentificationError(
            f"the recording '{recording.name}' has no dq, and its rate of {recording.rate_hz:.3g} "
            "Hz is too low to differentiate q; if its time is in ms, state that in a recipe"
        )
    if sentence := sentence_on_limits(recording.q, lib):
        raise IdentificationError(
            f"{sentence}; state unit, order, sign and offset in a recipe, or choose another --robot"
        )


def sentence_on_limits(q: Array, lib: Library) -> str:
    """Sentence on the joint of positions (N, n) that is farthest beyond its limits; "" for none."""
    limits = lib.limits()
    # A minimum over short rows takes ten times as long.
    joints = np.ascontiguousarray(q.T)
    low, high = joints.min(axis=1), joints.max(axis=1)
    beyond = np.maximum(limits["lower"] - low, high - limits["upper"])
    worst = int(np.argmax(beyond))
    if not beyond[worst] > BEYOND_LIMIT:
        return ""
    return (
        f"joint '{lib.joint_names[worst]}' moves from {low[worst]:.3g} to {high[worst]:.3g}, "
        f"its limits are {limits['lower'][worst]:.3g} to {limits['upper'][worst]:.3g} "
        f"{lib.manifest.joints[worst].unit}"
    )


def require_joints(recording: Recording, lib: Library) -> None:
    """Require that a recording has the joints of the robot."""
    n = lib.n_joints
    if recording.q.shape[1] != n:
        raise IdentificationError(
            f"the recording '{recording.name}' has {recording.q.shape[1]} joints, the robot "
            f"'{lib.name}' has {n} ({', '.join(lib.joint_names)}); choose --robot, or build it "
            "with --base, --tip and --lock"
        )


def unsigned_sentence(recording: Recording) -> str:
    """Sentence on torques or currents that are never negative at any joint; "" for others.

    Friction takes the sign of dq, and noise about zero both signs, so that a few joints of one sign
    may be loaded by gravity, all not.
    """
    tau = recording.required("tau")
    count = np.count_nonzero(np.ptp(tau, axis=0))
    if count < FEWEST_SIGNED or not np.ptp(recording.q) or tau.min() * tau.max() < 0:
        return ""
    side = "negative" if tau.min() >= 0 else "positive"
    return (
        f"no torque or current of {count} joints is ever {side}: the register or the "
        "logger has dropped the sign, without which friction and gravity cannot be "
        "separated; log the signed value (with the sign bit of the register), or describe the "
        "control law in the recipe, whose commanded torque has a sign"
    )


def _require_sign(recording: Recording, lib: Library) -> None:
    """Refuse a measured torque that correlates with minus the gravity torque of the model."""
    tau = recording.required("tau")
    still = np.zeros_like(recording.q)
    gravity = lib.inverse_dynamics(recording.q, still, still, lib.pi0)
    size = np.linalg.norm(gravity) * np.linalg.norm(tau)
    if size == 0:
        return
    alike = float(np.sum(gravity * tau) / size)
    if alike < -0.5:
        if sentence := unsigned_sentence(recording):
            raise IdentificationError(sentence)
        raise IdentificationError(
            f"the measured torque runs against the model's gravity torque (correlation "
            f"{alike:.2f}): either the log counts torque with the opposite sign (set sign = -1 "
            "for [torque] in a recipe), or gravity points the other way (build with --gravity)"
        )
