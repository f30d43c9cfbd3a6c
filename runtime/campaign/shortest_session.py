"""The shortest session whose expected error is within a target: approach, motion and return.

An identification fits rows A of the unknowns and columns K of friction to τ + e + M z. The noise e
has the standard deviation σ, z are errors of the model that nothing estimates, z_k ~ N(0, s_k²):

    C = (AᵀPA + κB)⁻¹,   P = W^½ (1 − K̃ K̃⁺) W^½,   errors = C^½ and C AᵀP M diag(s)

The mean square of any linear function of the unknowns is the sum of squares over both matrices.
Unknowns are the inertial parameters of the arm with the URDF as prior, or the ten of a payload
from an empty and a loaded run of the same session.

The duration of the motion follows from that of the last attempt: the error by noise decreases with
1/√T, that by the model stays as it is,

    T⁺ = T e_noise² / (value² − e_model²)

Target of a campaign: which standard deviation must fall below which value.

| target | standard deviation of |
|---|---|
| `v=5mNm` | the torque of motions never seen, all joints together [N·m]; mN or N where all slide |
| `a=1.5%` | the base parameters over their sizes, root mean square |
| `payload=5g` | the mass of a payload that the last motion carries on the identified arm |
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD, prior_of, spread_of
from runtime.estimators.regression.posterior import orthonormal, posterior_of
from runtime.estimators.uncertainty import Uncertainty
from runtime.excitation.motion.trajectory import JoinedMotion, Trajectory
from runtime.excitation.proof.certificate import pulled_inside
from runtime.excitation.search.criteria import PAYLOAD, covariance, sizes, unseen_joints
from runtime.excitation.search.design import Design, design
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import Information, information
from runtime.excitation.search.prediction import covariance_of, payload_sigma
from runtime.identification.expected_accuracy.planned_samples import with_earlier
from runtime.identification.identified import Identification
from runtime.library import Array, Library
from runtime.library.parameters import MASS, N_PARAMETERS
from runtime.recording import Friction
from runtime.recording.friction.columns import OFFSET
from runtime.recording.friction.coupled_motors import spread
from runtime.recording.friction.model import columns
from runtime.recording.settings import JointMotion

MOST_ROWS = 1500  # largest number of instants that stand for a session
SLOW = 0.05  # share of the velocity limit below which friction rises (Stribeck)
NOISE, GAINS, FRICTION, DELAY = (
    "noise, friction columns and offsets",
    "gains of the torque sensors",
    "friction beyond the columns",
    "delay of the torque",
)


@dataclass(frozen=True, slots=True)
class ModelError:
    """Standard deviations of errors of the model that an identification does not estimate."""

    gain: float = 0.005  # of every torque gain, relative to one
    # of friction that the columns miss, in each direction a share of the effort limit: a rise at
    # low speed, a cubic in the speed, and for a payload the change of Coulomb and viscous friction
    # between the runs
    friction: float = 0.001
    load: float = 0.01  # of the growth of friction with the torque in each direction, a share of it
    delay_s: float = 0.0005  # of the torque [s]


def error_parts_of(
    lib: Library,
    session: Trajectory | JoinedMotion,
    known: Information,
    error: ModelError,
    payload: bool = False,
) -> dict[str, Array]:
    """Expected errors of an identification: part → R of (10 n or 10, m), R Rᵀ its mean square."""
    count = int(np.clip(known.rate * session.duration, 50, MOST_ROWS))
    t = np.linspace(0.0, session.duration, count)
    q, dq, ddq, _ = session.at(lib, t)
    rows = lib.regressor(q, dq, ddq)
    missed = _missed(lib, t, dq, rows, error, payload)
    names, noise = known.friction, known.noise
    if payload:
        # Friction and the arm cancel between the runs; noise adds up, offsets drift.
        rows, names, noise = rows[:, :, -N_PARAMETERS:], (OFFSET.name,), np.sqrt(2.0) * noise
    weight = np.sqrt(known.rate * session.duration / count) / noise[:, None]
    scaled = [part * weight for part in (rows, *missed.values())]
    nuisance = spread(columns(JointMotion(dq), Friction(names)), None) * weight
    # Rows without their part along the friction columns.
    flat = [part.reshape(-1, part.shape[2]) for part in (nuisance, *scaled)]
    basis = orthonormal(flat[0])
    a, *rest = [part - basis @ (basis.T @ part) for part in flat[1:]]
    # Very large where the ten parameters of a payload are not determined.
    if payload:
        root = posterior_of(a, is_wide=True).root
    else:  # with the URDF as prior
        counted, arm = with_earlier(a, known.earlier, lib), prior_of(lib)
        root = spread_of(arm.bodies, arm.centre, counted, CAD).root
    gain = root @ (root.T @ a.T)
    return {NOISE: root} | {name: gain @ part for name, part in zip(missed, rest, strict=True)}


def _missed(
    lib: Library, t: Array, dq: Array, rows: Array, error: ModelError, payload: bool
) -> dict[str, Array]:
    """Columns M diag(s) by part, (N, n, k) each."""
    limits = lib.limits()
    tau = rows[:, :, -N_PARAMETERS:] @ PAYLOAD if payload else rows @ lib.pi0
    rate = np.gradient(tau, t, axis=0)
    effort = np.where(np.isfinite(limits["effort"]), limits["effort"], np.abs(tau).max(axis=0))
    fast = np.where(np.isfinite(limits["velocity"]), limits["velocity"], np.abs(dq).max(axis=0))
    share, level = dq / np.maximum(fast, np.finfo(float).tiny), error.friction * effort
    sign = np.tanh(share / (0.1 * SLOW))
    shapes = [level * sign * np.exp(-np.abs(share) / SLOW), level * share**3]
    if payload:
        shapes = [level * sign, level * share]
    shapes.append(error.load * np.abs(tau) * sign)
    # Both directions have their own coefficients: a motion out and back does not cancel them.
    both = [one * side for one in shapes for side in (dq > 0, dq < 0)]
    return {
        GAINS: spread((error.gain * tau)[:, :, None], None),
        FRICTION: np.concatenate([spread(one[:, :, None], None) for one in both], axis=2),
        DELAY: spread((error.delay_s * rate)[:, :, None], None),
    }


UNITS = {  # kind of target → unit → its size in SI units
    "v": {"mNm": 1e-3, "Nm": 1.0, "mN": 1e-3, "N": 1.0},
    "a": {"%": 0.01},
    "payload": {"g": 1e-3, "kg": 1.0},
}
_FORM = re.compile(r"(?P<kind>[a-z]+)=?(?P<number>[0-9.]+(e-?[0-9]+)?)(?P<unit>[A-Za-z%]+)")


@dataclass(frozen=True, slots=True)
class Target:
    """A target."""

    text: str  # as the user stated it
    kind: str  # "v", "a" or "payload"
    value: float  # largest standard deviation [N·m, 1, kg]
    unit: str  # of the text

    @property
    def criterion(self) -> str:
        """Criterion of its designs."""
        return "a" if self.kind == "payload" else self.kind

    def shown(self, value: float) -> str:
        """A standard deviation in the unit of the target."""
        return f"{value / UNITS[self.kind][self.unit]:.3g} {self.unit}"


def target_of(text: str) -> Target:
    """Target from its text."""
    match = _FORM.fullmatch(text.replace(" ", ""))
    if match and match["unit"] in UNITS.get(match["kind"], {}):
        value = float(match["number"]) * UNITS[match["kind"]][match["unit"]]
        if value > 0:
            return Target(text, match["kind"], value, match["unit"])
    raise IdentificationError(
        f"expected a target such as v=5mNm, a=1.5% or payload=5g, got '{text:.40}'; correct it"
    )


def reached(target: Target, result: Identification, motion: Trajectory) -> float:
    """Standard deviation of the quantity of a target, by the posterior of a result."""
    lib = result.lib
    if target.kind != "payload":
        return size_of(lib, target, motion.home, ModelError())(NOISE, posterior_in(result).root)
    # The error of the arm counts: information Tᵀ (G⁻¹ + C)⁻¹ T of the payload, with
    # G the information of this motion, C the covariance of β, T the columns of K of the last link.
    noise, rate = torque_noise(result)
    of_motion = covariance_of(lib, motion, information(lib, noise, rate), (OFFSET.name,))
    columns = lib.base_matrix[:, -N_PARAMETERS:]
    ten = covariance(columns.T @ np.linalg.solve(of_motion + base_covariance(result), columns))
    if ten is None:
        raise IdentificationError(
            f"a payload is not identifiable on '{lib.name}' by this motion; state v or a as target"
        )
    return payload_sigma(ten)[0]


def base_covariance(result: Identification) -> Array:
    """Covariance of β, (n_b, n_b), with the error of the estimate."""
    root = result.lib.base_matrix @ posterior_in(result).root
    return np.asarray(root @ root.T)


def posterior_in(result: Identification) -> Uncertainty:
    """Uncertainty of a result, which must have one."""
    if result.uncertainty is None:
        raise IdentificationError(
            f"expected a method with an uncertainty, got '{result.method}'; identify with map"
        )
    return result.uncertainty


def torque_noise(result: Identification) -> tuple[Array, float]:
    """σ (n,) of independent noise that stands for coloured residuals, and the rate of the rows."""
    uncertainty = posterior_in(result)
    return uncertainty.noise * np.sqrt(max(uncertainty.inflation, 1.0)), result.train.rate_hz


def known_before(result: Identification, lib: Library) -> Array:
    """Information G₀ over β of all logs and the prior of a result."""
    spread = base_covariance(result)
    floor = 1e-12 * np.trace(spread) / len(spread)  # β that the data fix to rounding
    inverse = np.linalg.inv(spread + floor * np.eye(len(lib.base_columns)))
    return np.asarray((inverse + inverse.T) / 2)


FIRST = 4.0  # duration of the first motion that is tried [s]
SHORTEST = 3.0  # shortest duration [s]: in less, small joints hardly move and two runs differ
LONGEST = 120.0  # longest duration that is tried [s]
ATTEMPTS = 8
CLOSE = 1.15
"""Ratio of the shortest duration that reaches the target to the longest that does not, at which the
search ends."""
PER_SECOND = 0.8  # harmonics per second of motion, up to the number of the settings
FEWEST_HARMONICS = 3


@dataclass(frozen=True, slots=True)
class PlannedSession:
    """A motion with its ways, and the expected error of their log."""

    design: Design  # of the motion
    parts: dict[str, float]  # part of the error → its size in the unit of the target's value
    total: float  # root of the sum of their squares
    target: Target  # what was to be reached
    attempts: dict[float, float]  # duration of every motion that was tried [s] → its error

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return self.design.trajectory.duration

    def sentence(self) -> str:
        """The error and its parts."""
        shown = self.target.shown
        parts = ", ".join(f"{name} {shown(value)}" for name, value in self.parts.items())
        runs = ""
        if self.target.kind == "payload":
            runs = "; an empty and a loaded run, whose limits --carry counts"
        return f"{self.target.text}: promised σ {shown(self.total)} ({parts}){runs}"

    def facts(self) -> dict[str, Any]:
        """JSON-ready content."""
        return {
            "target": self.target.text,
            "sigma": self.total,
            "parts": self.parts,
            "runs": 2 if self.target.kind == "payload" else 1,
        }


def shortest_session(
    lib: Library,
    target: Target,
    settings: DesignSettings,
    known: Information,
    error: ModelError,
    around: Callable[[Trajectory], Trajectory | JoinedMotion],
    **search: Any,
) -> PlannedSession:
    """Design motions until the shortest session within the target is found to `CLOSE`."""
    home = lib.home if settings.home is None else settings.home
    size = size_of(lib, target, home, error)
    attempts: dict[float, float] = {}
    best: PlannedSession | None = None
    last: PlannedSession | None = None
    duration, failed, hopeless = FIRST, 0.0, 0
    for _ in range(ATTEMPTS):
        optimum = _designed(lib, target, settings, duration, search)
        session = around(optimum.trajectory)
        roots = error_parts_of(lib, session, known, error, target.kind == "payload")
        parts = {name: size(name, root) for name, root in roots.items()}
        total, taken = float(np.linalg.norm(list(parts.values()))), optimum.trajectory.duration
        attempts[taken] = total
        last = PlannedSession(optimum, parts, total, target, attempts)
        if total <= target.value:
            best = last if best is None or taken < best.duration else best
        else:
            failed = max(failed, taken)
        if best is not None:
            if best.duration <= max(CLOSE * failed, SHORTEST):
                break
            # Between both ends; without a lower one, half.
            duration = float(np.sqrt(max(failed, best.duration / 4, SHORTEST / 2) * best.duration))
            duration = max(duration, SHORTEST)
            continue
        needed = _needed(parts[NOISE], total, target.value, session.duration, taken)
        hopeless += not np.isfinite(needed)
        if taken >= LONGEST or hopeless > 1:
            break
        duration = float(np.clip(needed, 1.3 * taken, min(3 * taken, LONGEST)))
    if best is None:
        raise _unreachable(target, last)
    return best


def size_of(
    lib: Library, target: Target, home: Array, error: ModelError
) -> Callable[[str, Array], float]:
    """Map from errors of the unknowns (10 n, m) to the RMS error of a target's quantity.

    v is the error of the measured torque: a gain changes measurement and model alike, and only
    what no parameters imitate is an error, g_j τ_j − Y_b δβ.
    """
    if target.kind == "payload":
        return lambda _, root: float(np.linalg.norm(root[MASS]))
    beta = lib.base_matrix @ lib.pi0
    if target.kind == "a":
        scale = sizes(lib, information(lib)) * np.sqrt(len(beta))
        return lambda _, root: float(np.linalg.norm(lib.base_matrix @ root / scale[:, None]))
    joints = unseen_joints(lib, home)
    seen = np.sum(joints, axis=0)

    def of_torque(name: str, root: Array) -> float:
        change = lib.base_matrix @ root
        square = float(np.sum(change * (seen @ change)))
        if name == GAINS:
            for j, joint in enumerate(joints):
                square += error.gain * float(beta @ joint @ (error.gain * beta - 2 * change[:, j]))
        return float(np.sqrt(max(square, 0.0)))

    return of_torque


def _designed(
    lib: Library, target: Target, settings: DesignSettings, duration: float, search: dict[str, Any]
) -> Design:
    harmonics = int(np.clip(round(PER_SECOND * duration), FEWEST_HARMONICS, settings.harmonics))
    harmonics, kind = min(harmonics, settings.harmonics), target.criterion
    chosen = replace(settings, duration=duration, harmonics=harmonics, criterion=kind)
    optimum = design(lib, chosen, **search)
    inside = pulled_inside(lib, optimum.trajectory, share=settings.margin)
    return replace(optimum, trajectory=inside)


def _needed(noise: float, total: float, value: float, whole: float, taken: float) -> float:
    """Duration of the motion for the error of the target; the ways count as seconds of it."""
    rest = value**2 - (total**2 - noise**2)
    return np.inf if rest <= 0 else 1.02 * whole * noise**2 / rest - (whole - taken)


def _unreachable(target: Target, last: PlannedSession | None) -> IdentificationError:
    if last is None:
        return IdentificationError("expected at least one attempt")
    name = max(last.parts, key=lambda part: last.parts[part])
    advice = {
        GAINS: "measure the gains (symgen gains) and state their error with the setting gain_error",
        NOISE: "state a smaller --noise, or a larger target",
    }.get(name, "state a larger target")
    longest = max(last.attempts)
    return IdentificationError(
        f"expected a target that a motion of up to {LONGEST:g} s reaches, got '{target.text}': "
        f"after {longest:.3g} s {target.shown(last.attempts[longest])} are expected, of which "
        f"{name} {target.shown(last.parts[name])}; {advice}"
    )
