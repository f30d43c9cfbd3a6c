"""Motions q(t) = home + Σ_m a_m φ_m(t) per joint, at rest at both ends (Eqs. 3.24–3.28), and JSON.

The functions φ of s = t/t_f vanish at both ends with two derivatives. On request the third
derivative vanishes at both ends too; the polynomials gain two degrees then. Another package adds a
basis by an entry point of the group "symgen.bases". With w = 2πm and u = s(1−s):

    cosine   cos ws − 1 + ½w² u² (Eqs. 3.24–3.27), its own mirror image about t_f/2: out and back
    fourier  the cosines, then sin ws − w (s − 10s³ + 15s⁴ − 6s⁵)
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyval

from runtime.common.files import json_of, write_json
from runtime.errors import IdentificationError, RecordingError
from runtime.excitation.motion.family import TRANSFER, Basis, BasisFamily, Spline
from runtime.library import Array, Library
from runtime.registry import Registry

_S = Polynomial([0.0, 1.0])
_U = Polynomial([0.0, 1.0, -1.0])


class UnitPolynomial:
    """A polynomial on 0 ≤ s ≤ 1, with its derivatives and the largest size of each."""

    def __init__(self, polynomial: Polynomial) -> None:
        every = [polynomial]
        for _ in range(polynomial.degree() + 1):
            every.append(every[-1].deriv())
        self._coefficients = [one.coef for one in every]
        self._suprema = [_supremum(one) for one in every]

    def derivative(self, order: int, s: Array) -> Array:
        """Derivative of the polynomial at s (N,)."""
        k = min(order, len(self._coefficients) - 1)
        return np.asarray(polyval(s, self._coefficients[k]))

    def supremum(self, order: int) -> float:
        """Largest |d^k p/ds^k| over 0 ≤ s ≤ 1."""
        return self._suprema[min(order, len(self._suprema) - 1)]


def _supremum(polynomial: Polynomial) -> float:
    """Largest |p| over 0 ≤ s ≤ 1: at an end or where the slope vanishes."""
    turns = polynomial.deriv().roots()
    inside = turns.real[(abs(turns.imag) < 1e-6) & (turns.real > 0) & (turns.real < 1)]
    return float(np.abs(polynomial(np.concatenate([[0.0, 1.0], inside]))).max() * (1 + 1e-12))


_HUMPS = UnitPolynomial(_U**2), UnitPolynomial(_U**2 + 2 * _U**3)
"""Polynomials with curvature 2 at both ends; the second has no third derivative there."""
_RAMPS = (  # polynomials with slope 1 at both ends; third derivative −60 there, and none
    UnitPolynomial(_S - _S**3 * Polynomial([10.0, -15.0, 6.0])),
    UnitPolynomial(_S - _S**4 * Polynomial([35.0, -84.0, 70.0, -20.0])),
)
_JOLT = UnitPolynomial(_U**3 * Polynomial([1.0, -2.0]) / 6)  # third derivative 1 at both ends


@dataclass(frozen=True, slots=True)
class Cosine(Basis):
    """Basis of the document: inertia, even in dq, and friction, odd in dq, are orthogonal."""

    zero_jerk: bool = False
    name = "cosine"
    is_symmetric = True

    @property
    def equation(self) -> str:
        """Equation as text, for files."""
        u = "(s^2 (1-s)^2 + 2 s^3 (1-s)^3)" if self.zero_jerk else "s^2 (1-s)^2"
        return f"q = home + sum_m a_m (cos 2 pi m s - 1 + 2 pi^2 m^2 {u}), s = t/t_f"

    def size(self, harmonics: int) -> int:
        """Number of functions: one cosine per harmonic."""
        return harmonics

    def at(self, lib: Library, size: int, t: Array, duration: float) -> Array:
        """Functions (N, size, 4) at times (N,), by the generated kernel where there is one."""
        if self.zero_jerk:
            return Basis.at(self, lib, size, t, duration)
        return fourier_basis(lib, size, t, duration)

    def derivatives(self, orders: int, size: int, s: Array) -> Array:
        """Derivatives w^k cos(ws + kπ/2) − [k = 0] + ½w² dᵏ/dsᵏ of the polynomial."""
        w = _frequencies(size)
        result = _waves(orders, w, s, 0)
        result[0] -= 1
        for k in range(orders):
            result[k] += np.multiply.outer(_HUMPS[self.zero_jerk].derivative(k, s), w**2 / 2)
        return result

    def bound(self, order: int, size: int) -> Array:
        """Sum of the bounds of the wave and of the polynomial."""
        w = _frequencies(size)
        hump = _HUMPS[self.zero_jerk].supremum(order)
        return np.asarray(w**order * (2 if order == 0 else 1) + w**2 / 2 * hump)


@dataclass(frozen=True, slots=True)
class Fourier(Basis):
    """Cosines and sines: half the condition number with as many harmonics, but not out and back."""

    zero_jerk: bool = False
    name = "fourier"
    is_symmetric = False

    @property
    def equation(self) -> str:
        """Equation as text, for files."""
        ramp, jolt = "s - 10 s^3 + 15 s^4 - 6 s^5", ""
        if self.zero_jerk:
            ramp = "s - 35 s^4 + 84 s^5 - 70 s^6 + 20 s^7"
            jolt = " + w^3 s^3 (1-s)^3 (1-2s) / 6"
        cosine = Cosine(self.zero_jerk).equation.removesuffix(", s = t/t_f")
        return (
            f"{cosine} + sum_m b_m (sin w s - w ({ramp}){jolt}), w = 2 pi m, s = t/t_f; "
            "the coefficients are a_1..a_M, b_1..b_M"
        )

    def size(self, harmonics: int) -> int:
        """Number of functions: a cosine and a sine per harmonic."""
        return 2 * harmonics

    def derivatives(self, orders: int, size: int, s: Array) -> Array:
        """Derivatives of the cosines, then of the sines, (orders, N, size)."""
        w = _frequencies(size // 2)
        sines = _waves(orders, w, s, 1)
        for k in range(orders):
            sines[k] -= np.multiply.outer(_RAMPS[self.zero_jerk].derivative(k, s), w)
            if self.zero_jerk:
                sines[k] += np.multiply.outer(_JOLT.derivative(k, s), w**3)
        cosines = Cosine(self.zero_jerk).derivatives(orders, size // 2, s)
        return np.concatenate([cosines, sines], axis=2)

    def bound(self, order: int, size: int) -> Array:
        """Sum of the bounds of the wave and of the polynomials."""
        w = _frequencies(size // 2)
        sines = w**order + w * _RAMPS[self.zero_jerk].supremum(order)
        if self.zero_jerk:
            sines += w**3 * _JOLT.supremum(order)
        return np.concatenate([Cosine(self.zero_jerk).bound(order, size // 2), sines])


def fourier_basis(lib: Library, harmonics: int, t: Array, duration: float) -> Array:
    """Cosines φ_m(t) by the generated kernel."""
    m = np.arange(1, harmonics + 1, dtype=float)
    times, orders = np.repeat(t, harmonics), np.tile(m, len(t))
    return lib.harmonic_basis(orders, times, duration).reshape(len(t), harmonics, 4)


def _frequencies(harmonics: int) -> Array:
    return 2 * np.pi * np.arange(1, harmonics + 1, dtype=float)


def _waves(orders: int, w: Array, s: Array, sine: int) -> Array:
    """Derivatives d^k/ds^k of cos ws, or of sin ws, (orders, N, M): w^k cos(ws + kπ/2)."""
    angle = np.multiply.outer(s, w)
    waves, signs = (np.cos(angle), np.sin(angle)), (1, -1, -1, 1)
    result = np.empty((orders, *angle.shape))
    for k in range(orders):
        turn = (k - sine) % 4
        np.multiply(waves[turn % 2], signs[turn] * w**k, out=result[k])
    return result


COSINE_FAMILY = BasisFamily("cosine", "cosines, out and back, the document's", Cosine)
FOURIER_FAMILY = BasisFamily("fourier", "cosines and sines", Fourier)

GAP = 1e-6  # largest distance between the end of a motion and the start of the next [rad, m]
WAYS = ("approach", "return")  # names of the parts before and after a motion
COSINE = Cosine()  # the default basis
BASES = Registry(  # all bases of excitation motions by name; these return home
    "symgen.bases",
    BasisFamily,
    "basis",
    {
        "cosine": "runtime.excitation.motion.trajectory:COSINE_FAMILY",
        "fourier": "runtime.excitation.motion.trajectory:FOURIER_FAMILY",
        "bspline": "runtime.excitation.motion.family:SPLINE_FAMILY",
    },
    IdentificationError,
)
LONGEST = 3600.0  # longest motion, s; beyond it the grid of the limits exceeds the memory
LARGEST_NUMBER = 1e6  # largest number of a trajectory that is read, in SI units
MOST_SAMPLES = 10_000_000  # most samples: more exceed the memory of an ordinary computer


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Motion q(t) of n joints from `home`, at rest at both ends; back to it with most bases."""

    home: Array  # (n,) rad or m
    coefficients: Array  # a, (n, M) rad or m
    duration: float  # t_f, s
    basis: Basis = COSINE  # functions φ

    def at(self, lib: Library, t: Array) -> tuple[Array, Array, Array, Array]:
        """States at given times.

        Args:
            lib: the robot.
            t: times, (N,) s.

        Returns:
            q, dq, ddq, dddq, (N, n) each.
        """
        basis = self.basis.at(lib, self.coefficients.shape[1], t, self.duration)
        q, dq, ddq, dddq = np.einsum("jm,tmd->dtj", self.coefficients, basis)
        return q + self.home, dq, ddq, dddq

    @property
    def parts(self) -> "tuple[Trajectory, ...]":
        """The motion itself: that of several in a row has more."""
        return (self,)

    @property
    def starts(self) -> tuple[float, ...]:
        """Time at which it begins [s]."""
        return (0.0,)

    def slowed(self, speed: float) -> "Trajectory":
        """The same path at a lower speed, in the duration t_f / speed."""
        return replace(self, duration=self.duration / require_speed(speed))


def require_speed(speed: float) -> float:
    """The speed itself, where it is a share above 0 and up to 1."""
    if not 0 < speed <= 1:
        raise IdentificationError(
            f"a replay needs a speed above 0 and up to 100 %, got {100 * speed:g} %; a faster "
            "motion must be designed with a shorter --duration"
        )
    return speed


def basis_of(name: str, zero_jerk: bool = False) -> Basis:
    """The basis of this name."""
    if name == TRANSFER:
        return Spline(zero_jerk, arrives=True)
    return BASES[name].make(zero_jerk)


def sample_times(duration: float, rate_hz: float) -> Array:
    """Times 0, 1/rate, … up to the duration.

    Args:
        duration: s.
        rate_hz: sampling rate, Hz.

    Returns:
        (N,) s.

    Raises:
        IdentificationError: values that make no clock, or one of more than `MOST_SAMPLES`.
    """
    samples = duration * rate_hz
    if not (duration > 0 and rate_hz > 0 and samples < MOST_SAMPLES):
        raise IdentificationError(
            "a motion needs a positive duration and sampling rate that make fewer than "
            f"{MOST_SAMPLES:,} samples, got {duration:g} s and {rate_hz:g} Hz"
        )
    return np.arange(round(samples) + 1) / rate_hz


@dataclass(frozen=True, slots=True)
class JoinedMotion:
    """Several motions in a row, as one motion."""

    parts: tuple[Trajectory, ...]  # the motions in their order
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        if not self.parts or len(self.parts) != len(self.names):
            raise IdentificationError("joined motions need at least one part and one name for each")
        for before, after in zip(self.parts, self.parts[1:], strict=False):
            away = float(np.abs(end_of(before) - after.home).max())
            if not away <= GAP:
                raise IdentificationError(
                    f"expected a motion that begins where the last one ends, it begins {away:.3g} "
                    "rad or m away; plan the way between them"
                )

    @property
    def home(self) -> Array:
        """Start of the first part, (n,) [rad, m]."""
        return self.parts[0].home

    @property
    def duration(self) -> float:
        """Duration of all parts together [s]."""
        return sum(part.duration for part in self.parts)

    @property
    def starts(self) -> tuple[float, ...]:
        """Times at which the parts begin [s]."""
        return tuple(sum(part.duration for part in self.parts[:k]) for k in range(len(self.parts)))

    def at(self, lib: Library, t: Array) -> tuple[Array, Array, Array, Array]:
        """States (N, n) at times (N,); where parts meet, those of the later one."""
        t = np.asarray(t, dtype=float)
        states = np.empty((4, len(t), lib.n_joints))
        which = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, None)
        for k, (part, start) in enumerate(zip(self.parts, self.starts, strict=True)):
            rows = np.flatnonzero(which == k)
            if rows.size:
                states[:, rows] = part.at(lib, np.clip(t[rows] - start, 0.0, part.duration))
        q, dq, ddq, dddq = states
        return q, dq, ddq, dddq

    def slowed(self, speed: float) -> "JoinedMotion":
        """All parts at a share of their speeds, above 0 and up to 1."""
        return replace(self, parts=tuple(part.slowed(speed) for part in self.parts))


Motion = Trajectory | JoinedMotion  # one, or several in a row


def end_of(trajectory: Trajectory) -> Array:
    """Place at which a motion ends, (n,) [rad, m]."""
    basis, a = trajectory.basis, trajectory.coefficients
    return np.asarray(trajectory.home + a @ basis.derivatives(1, a.shape[1], np.ones(1))[0, 0])


def joined(
    approach: Trajectory | None, motion: Trajectory, back: Trajectory | None
) -> JoinedMotion:
    """Approach, motion and return as one motion."""
    parts = zip((WAYS[0], "motion", WAYS[1]), (approach, motion, back), strict=True)
    given = {name: part for name, part in parts if part is not None}
    return JoinedMotion(tuple(given.values()), tuple(given))


def write_motion(
    trajectory: Trajectory,
    lib: Library,
    path: Path,
    known: dict[str, Any] | None = None,
    ways: Mapping[str, Trajectory] | None = None,
) -> None:
    """Write a trajectory and further facts, atomically."""
    facts = {
        "robot": lib.name,
        "joints": list(lib.joint_names),
        **_facts(trajectory),
        **(known or {}),
        **{name: _facts(way) for name, way in (ways or {}).items()},
    }
    write_json(path, facts, allow_nan=True)


def _facts(trajectory: Trajectory) -> dict[str, Any]:
    basis = trajectory.basis
    return {
        "basis": basis.equation,
        "basis_name": basis.name,
        "zero_jerk_at_ends": basis.zero_jerk,
        "duration": trajectory.duration,
        "home": trajectory.home.tolist(),
        "coefficients": trajectory.coefficients.tolist(),
    }


def read_session(path: Path, lib: Library) -> JoinedMotion:
    """Read a motion with the ways to its start and back that its file holds."""
    motion = read_trajectory(path, lib)
    facts = json_of(path)
    approach, back = (
        _trajectory(facts[name], facts["joints"], path, lib) if name in facts else None
        for name in WAYS
    )
    return joined(approach, motion, back)


def read_trajectory(path: Path, lib: Library) -> Trajectory:
    """Read a trajectory of this robot; a file without the name of a basis has cosines."""
    try:
        facts = json_of(path)
        joints = facts["joints"]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise _no_trajectory(path, error) from None
    return _trajectory(facts, joints, path, lib)


def _no_trajectory(path: Path, error: Exception) -> RecordingError:
    return RecordingError(
        f"'{path}' is not a trajectory ({type(error).__name__}); make one with: "
        "python -m runtime excite"
    )


def _trajectory(facts: Any, joints: object, path: Path, lib: Library) -> Trajectory:
    """A trajectory of a file, checked against its robot."""
    try:
        trajectory = Trajectory(
            np.array(facts["home"], dtype=float),
            np.array(facts["coefficients"], dtype=float),
            float(facts["duration"]),
            basis_of(facts.get("basis_name", COSINE.name), facts.get("zero_jerk_at_ends") is True),
        )
    except IdentificationError as error:
        raise RecordingError(f"the trajectory '{path}' cannot be read: {error}") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise _no_trajectory(path, error) from None
    n = lib.n_joints
    shape = trajectory.coefficients.shape
    fits = trajectory.home.shape == (n,) and len(shape) == 2 and shape[0] == n
    if joints != list(lib.joint_names) or not fits or not trajectory.coefficients.size:
        raise RecordingError(f"the trajectory '{path}' belongs to another robot than '{lib.name}'")
    if shape[1] % trajectory.basis.size(1):
        raise RecordingError(
            f"the trajectory '{path}' has {shape[1]} coefficients per joint, its basis "
            f"'{trajectory.basis.name}' takes pairs of coefficients; make one with: "
            "python -m runtime excite"
        )
    numbers = [*trajectory.home, *trajectory.coefficients.ravel(), trajectory.duration]
    if not (np.abs(numbers) < LARGEST_NUMBER).all() or not 0 < trajectory.duration <= LONGEST:
        raise RecordingError(
            f"the trajectory '{path}' holds numbers beyond {LARGEST_NUMBER:g} or not finite, or a "
            f"duration that is not positive or beyond {LONGEST:g} s; make one with: "
            "python -m runtime excite"
        )
    return trajectory
