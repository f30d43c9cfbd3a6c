"""Checks of the delay of a torque, and of a commanded one: its law, and the share of the drives.

    τ(t − d) = Y π0 + F φ + J ddq

A commanded torque includes what rotors and friction of the drives take before it reaches the links.
The delay is that which `identify` estimates.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.estimators.choice.dry_friction import with_dry_friction
from runtime.estimators.regression.posterior import least_squares
from runtime.estimators.regression.recorded_delay import (
    DelayProfile,
    filtered,
    recorded_delay,
    stated_delay,
)
from runtime.estimators.regression.samples import NORMAL_95, Samples, samples_of
from runtime.inspection.finding import INFO, WARNING, Checked, Finding
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recipe, Recording
from runtime.recording.friction.columns import ROTOR
from runtime.recording.friction.model import DRIVE
from runtime.recording.preprocessing import prepare
from runtime.recording.recipes.recipe import Gain
from runtime.recording.settings import COLUMNS

DOMINANT = 0.5  # share of the torque that links leave unexplained from which the drives dominate
REMOVED = 0.5  # share of that rest that the drives must explain
STILL = 0.02  # travel [rad or m] below which a joint does not count
WRONG_GAIN = 1.5  # factor on the gains of a law that no usual error of a URDF explains
CLEAR = 3.0  # factor over its standard deviation from which on it is named
LATE = 4.0  # delay over its standard deviation from which on it is to be corrected
LONGEST_S, SHARE = 1.0, 0.1  # largest delay of a torque [s], and over the duration
LATE_GAIN = 0.03
"""Share of the squared residual, geometric mean of the joints, that it must explain: 0.05 of 30 ms
in motor currents; smaller ones change the result less than errors of the friction model."""
LEAST_STEPS = 0.3  # the same delay in steps of the log from which on it is to be corrected


def commanded(recording: Recording, plan: Recipe) -> list[Finding]:
    """Finding that the torque is computed by a control law."""
    law = plan.law
    if law is None:
        return []
    sentence = (
        f"the log measures no torque: τ is commanded by its {law}; it includes rotors and "
        "friction, and a wrong gain kp scales masses and friction alike; check kp and kd with "
        "the driver of the robot"
    )
    evidence = {"law": law.law, "source": recording.torque_source}
    return [Finding("commanded_torque", INFO, sentence, evidence)]


def law_gain(recording: Recording, plan: Recipe, lib: Library) -> Checked:
    """Gains that carry the links of the URDF: τ_law = Y π0 / c + F φ with one c for all joints."""
    law = plan.law
    if law is None or not isinstance(law.kp, float | tuple):
        return plan, []
    usual = filtered(recording, plan.preparation)
    columns = Friction(tuple(name for name in DRIVE if not COLUMNS[name].is_constant))
    samples = samples_of(prepare(recording, usual, columns, lib=lib), lib)
    links, _ = _left(samples, samples.rigid(lib, lib.pi0), len(columns.columns))
    torque, _ = _left(samples, samples.tau, len(columns.columns))
    weights = np.sum(links**2, axis=0)
    each = np.sum(links * torque, axis=0) / np.where(weights > 0, weights, 1.0)
    shares = weights / weights.sum() if weights.any() else weights
    inverse, squares = float(shares @ each), float(shares @ shares)
    # Scatter of the joints that carry weight; 1 / squares is their effective number.
    sigma = float(np.sqrt(shares**2 @ (each - inverse) ** 2 / max(1 - squares, 1e-9)))
    if not inverse > CLEAR * sigma:
        return plan, []
    factor, spread = 1 / inverse, sigma / inverse
    if abs(np.log(factor)) < max(np.log(WRONG_GAIN), CLEAR * spread):
        return plan, []
    other = replace(law, kp=_scaled(law.kp, factor), kd=_scaled(law.kd, factor))
    sentence = (
        f"the {law} carries {100 * inverse:.3g} % of the weight of the URDF's links, and the "
        f"{other} all of it (joints differ by {100 * spread:.0f} %): proposed; take the gains of "
        "the driver where they are known"
    )
    finding = Finding("law_gain", WARNING, sentence, {"factor": factor, "spread": spread})
    return plan.replace(law=other), [finding]


def _scaled(gain: Gain, factor: float) -> Gain:
    if isinstance(gain, tuple):
        return tuple(float(f"{factor * x:.3g}") for x in gain)
    return gain if isinstance(gain, str) else float(f"{factor * gain:.3g}")


def friction_of(recording: Recording, lib: Library, plan: Recipe) -> Friction:
    """Friction columns of the drives: of the recipe with rotors, else as `identify` chooses."""
    written = plan.friction
    if written is not None and ROTOR.name in written.columns:
        return written
    return with_dry_friction([(recording, plan.preparation)], lib, Friction(DRIVE), late=True)[0]


def _delay(seen: DelayProfile, of: str, remedy: str) -> tuple[Finding, str]:
    """The delay as information, or that it is not determined; and its interval in words."""
    low, high = seen.interval_s
    sizes = {"delay_s": seen.delay_s, "sigma_s": seen.sigma, "gain": seen.gain}
    evidence: dict[str, Any] = {
        **({"delay_s": None} if seen.is_flat else sizes),
        "interval_s": [low, high],
        "profile": {
            "delay_s": [float(seen.sign * x) for x in seen.delays],
            "loss": [float(x) for x in seen.loss],
        },
    }
    sentence = (
        f"the delay of the {of} torque is not determined: the loss is flat or least at an end of "
        f"the range (interval {1e3 * low:.0f} to {1e3 * high:.0f} ms); record a faster motion"
        f"{remedy}"
    )
    within = f"95 % interval {1e3 * low:.1f} to {1e3 * high:.1f} ms"
    return Finding("delay", INFO, sentence, evidence), within


def delay_of_measured(
    recording: Recording, lib: Library, plan: Recipe, terms: Friction, *, has_gains: bool = True
) -> list[Finding]:
    """Delay of τ behind q: a warning where it is to be corrected, and the estimate in any case."""
    reach, step = min(LONGEST_S, SHARE * recording.duration), 1.0 / recording.rate_hz
    if not has_gains and ROTOR.name not in terms.columns:  # currents of motors drive their rotors
        terms = replace(terms, columns=(*terms.columns, ROTOR.name))
    seen = recorded_delay(recording, lib, plan.preparation, terms, reach, has_gains=has_gains)
    late, sigma, gain = seen.delay_s, seen.sigma, seen.gain
    finding, within = _delay(seen, "measured", " to estimate it")
    if seen.is_flat:
        return [finding]
    sentence = (
        f"the measured torque is stamped {1e3 * late:.1f} ms after the motion ({within}); friction "
        "with a memory looks like a delay of some ms"
    )
    stated = replace(finding, sentence=sentence)
    excess = late - stated_delay(plan.preparation)
    if gain < LATE_GAIN or abs(excess) < max(LATE * sigma, LEAST_STEPS * step):
        return [stated]
    which = "later" if late > 0 else "earlier"
    sentence = (
        f"τ is stamped {1e3 * abs(late):.2f} ms {which} than q (± {1e3 * NORMAL_95 * sigma:.2f}"
        f" ms, {abs(late) / step:.2g} samples; up to {reach:.2g} s were searched): shifting it "
        f"back removes {100 * gain:.0f} % of the squared residual; set torque_delay_s = "
        f"{late:.2g} under [preparation]"
    )
    evidence = {"delay_s": late, "sigma_s": sigma, "gain": gain, "searched_s": reach}
    return [Finding("time_shift", WARNING, sentence, evidence), stated]


def delay(recording: Recording, lib: Library, plan: Recipe, terms: Friction) -> Checked:
    """Delay of a commanded torque by the loss over the delay, links of the URDF, drives free."""
    seen = recorded_delay(recording, lib, plan.preparation, terms)
    value = seen.delay_s
    finding, within = _delay(seen, "commanded", ", or take the delay from the driver")
    if seen.is_flat:
        return plan, [finding]
    written = plan.preparation.torque_delay_s
    sentence = (
        f"the commanded torque acts {1e3 * value:.1f} ms after its stamp ({within}, with the links "
        "of the URDF)"
    )
    if written is not None:
        sentence += f"; the recipe has torque_delay_s = {written} under [preparation]"
        return plan, [replace(finding, sentence=sentence)]
    if abs(value) < LATE * seen.sigma:
        return plan, [replace(finding, sentence=sentence)]
    late = float(f"{seen.sign * value:.3g}")
    sentence += (
        f": shifting it removes {100 * seen.gain:.0f} % of the squared residual; estimate it "
        f"with identify --delay auto, or set torque_delay_s = {late:g} under [preparation]"
    )
    shifted = replace(plan.preparation, torque_delay_s=late)
    return plan.replace(preparation=shifted), [replace(finding, level=WARNING, sentence=sentence)]


@dataclass(frozen=True, slots=True)
class Shares:
    """Median ‖rest_j‖/‖τ_j‖ of moving joints, robust to a gripper at its stop; rotors [SI]."""

    links: float
    friction: float
    drives: float
    armature: Array


def rotor(recording: Recording, lib: Library, plan: Recipe, terms: Friction) -> list[Finding]:
    """Rotors and friction that take most of the torque which the links of the URDF leave."""
    shares = shares_of(recording, lib, plan.preparation)
    if shares is None or shares.links < DOMINANT or shares.drives > (1 - REMOVED) * shares.links:
        return []
    columns = plan.friction.columns if plan.friction else ()
    handled = ROTOR.name in columns
    strong = [int(j) for j in np.flatnonzero(shares.armature > 0)]
    proposals = ", ".join(f"{lib.joint_names[j]} {shares.armature[j]:.2g}" for j in strong)
    sentence = (
        f"rotors and friction of the drives dominate: the links of the URDF alone leave "
        f"{100 * shares.links:.0f} % of the torque unexplained (median of the joints), with "
        f"viscous and Coulomb friction "
        f"{100 * shares.friction:.1f} %, with rotor inertia as well {100 * shares.drives:.1f} %; "
    )
    listed = ", ".join(terms.columns)
    sentence += (
        "the recipe has the column rotor" if handled else f"use the friction columns {listed}"
    )
    if strong:
        sentence += f"; first rotor inertias {proposals} kg·m²"
    evidence = {
        "unexplained_by_links": shares.links,
        "unexplained_with_friction": shares.friction,
        "unexplained_with_rotors": shares.drives,
        "armature": [float(x) for x in shares.armature],
    }
    level = INFO if handled else WARNING
    return [Finding("rotor", level, sentence, evidence)]


def shares_of(recording: Recording, lib: Library, preparation: Preparation) -> Shares | None:
    """Shares of the joints that move; None where none does."""
    usual = replace(filtered(recording, preparation), torque_delay_s=preparation.torque_delay_s)
    bare = recording.replace(columns=None, column_names=(), motors=None)
    samples = samples_of(prepare(bare, usual, Friction(DRIVE), lib=lib), lib)
    size = np.linalg.norm(samples.tau, axis=0)
    moving = (np.ptp(samples.q, axis=0) > STILL) & (size > 0)
    if not moving.any():
        return None
    rest = samples.tau - samples.rigid(lib, lib.pi0)
    friction, _ = _left(samples, rest, DRIVE.index(ROTOR.name))
    drives, x = _left(samples, rest, len(DRIVE))

    def share(values: Array) -> float:
        return float(np.median(np.linalg.norm(values[:, moving], axis=0) / size[moving]))

    armature = np.where(moving, np.maximum(x[:, DRIVE.index(ROTOR.name)], 0.0), 0.0)
    return Shares(share(rest), share(friction), share(drives), armature)


def _left(samples: Samples, rest: Array, columns: int) -> tuple[Array, Array]:
    """Residual (N, n) and coefficients (n, k) of the first columns, joint by joint."""
    fits = [
        least_squares(samples.columns[:, j, :columns], rest[:, j]) for j in range(rest.shape[1])
    ]
    return np.stack([left for _, left in fits], axis=1), np.stack([x for x, _ in fits])
