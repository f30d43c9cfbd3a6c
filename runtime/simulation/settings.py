"""Settings of a virtual robot beside its inertia: rotors, friction, sensors, drive, controller.

    [inertia]     spread (of the truth about the model), rotor [kg·m²]
    [friction]    see `runtime.simulation.virtual_robot`
    [sensors]     quanta, noise, bias, gain; see `runtime.simulation.sensors`
    [drive]       delay_s of the torque, step_s of the engine
    [controller]  law, stiffness K_p [1/s²], damping K_d [1/s], rate_hz

Every entry is one number, or where it belongs to joints one per joint. Entries that no file states
follow from the limits of the robot, so that every robot has plausible settings.
`simulation/robots/NAME.toml` is used for the robot of that name; a user's file replaces single
entries of it.
"""

import dataclasses
import difflib
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import toml_of
from runtime.errors import IdentificationError
from runtime.library import Array, Library

LAWS = ("computed_torque", "feedforward")
"""Control laws; the first one where none is stated."""
FOLDER = Path(__file__).parent / "robots"
_PLAIN = {
    "inertia": ("spread", "rotor"),
    "drive": ("delay_s", "step_s"),
    "controller": ("law", "stiffness", "damping", "rate_hz"),
}
_SINGLE = ("spread", "delay_s", "step_s", "rate_hz")
_ABOVE_ZERO = ("stribeck_speed", "dahl_stroke", "velocity_cutoff_hz", "step_s", "rate_hz", "rotor")
_ANY_SIGN = ("ripple_phase",)
_MOST_SPREAD = 1.0
"""Largest spread, exp(±1) on every principal moment: more than manufacturing leaves."""
_WHOLE = 1e-6
"""Relative tolerance of a number of steps, for the rounding of decimals."""


@dataclass(frozen=True, slots=True)
class VirtualFriction:
    """Friction per joint (n,): N·m, N·m·s/rad, rad and the like; shares are of `coulomb`."""

    coulomb: Array
    asymmetry: Array
    stribeck: Array
    stribeck_speed: Array
    viscous: Array
    load: Array
    ripple: Array
    ripple_waves: Array
    ripple_phase: Array
    dahl_stroke: Array


@dataclass(frozen=True, slots=True)
class Sensors:
    """Sensors per joint (n,); gain and bias of a robot are drawn with these deviations."""

    position_quantum: Array
    position_noise: Array
    velocity_cutoff_hz: Array
    torque_gain: Array
    torque_bias: Array
    torque_noise: Array
    torque_quantum: Array


@dataclass(frozen=True, slots=True)
class VirtualRobotSettings:
    """Settings of one virtual robot; arrays are (n,)."""

    friction: VirtualFriction
    sensors: Sensors
    rotor: Array
    stiffness: Array
    damping: Array
    spread: float
    delay_s: float
    step_s: float
    rate_hz: float
    law: str

    def facts(self) -> dict[str, Any]:
        """The settings as the tables of a file."""
        parts: dict[str, Any] = {
            table: {key: _plain(getattr(self, key)) for key in keys}
            for table, keys in _PLAIN.items()
        }
        for table in _GROUPS:
            parts[table] = {
                k: _plain(v) for k, v in dataclasses.asdict(getattr(self, table)).items()
            }
        return parts

    @property
    def sha256(self) -> str:
        """Hash of the facts."""
        return hashlib.sha256(json.dumps(self.facts(), sort_keys=True).encode()).hexdigest()


def settings_of(lib: Library, path: Path | None = None) -> VirtualRobotSettings:
    """Settings of a robot: by its limits, then the bundled file, then that of the user.

    Args:
        lib: the robot.
        path: TOML, or the name of a bundled one.

    Returns:
        The settings.

    Raises:
        IdentificationError: a file has an unknown key, or a value that no robot has.
    """
    tables = by_limits(lib)
    bundled = FOLDER / f"{lib.name}.toml"
    chosen = [bundled] if bundled.is_file() else []
    if path is not None:
        named = FOLDER / f"{path}.toml"
        chosen.append(named if path.suffix != ".toml" and named.is_file() else path)
    for file in chosen:
        _merge(tables, _read(file), file.name)
    return settings_from(tables, lib)


def settings_from(tables: Mapping[str, Mapping[str, Any]], lib: Library) -> VirtualRobotSettings:
    """Settings from complete tables."""
    groups = {
        table: kind(
            **{key: _numbers(table, key, value, lib) for key, value in tables[table].items()}
        )
        for table, kind in _GROUPS.items()
    }
    plain: dict[str, Any] = {}
    for table, keys in _PLAIN.items():
        for key in keys:
            value = tables[table][key]
            plain[key] = _law(value) if key == "law" else _numbers(table, key, value, lib)
            if key in _SINGLE:
                plain[key] = _single(table, key, plain[key])
    made = VirtualRobotSettings(**groups, **plain)
    if made.spread > _MOST_SPREAD:
        raise IdentificationError(
            f"[inertia] spread expects 0 to {_MOST_SPREAD:g}, got {made.spread:g}; 0.02 is usual"
        )
    periods = (("a period of the controller", 1 / made.rate_hz, 1), ("delay_s", made.delay_s, 0))
    for name, seconds, least in periods:
        steps = seconds / made.step_s
        if abs(steps - round(steps)) > _WHOLE * max(steps, 1.0) or round(steps) < least:
            raise IdentificationError(
                f"[drive] step_s of {made.step_s:g} s does not go into {name} of {seconds:g} s a "
                "whole number of times; change one of them"
            )
    return made


_GROUPS: dict[str, type] = {"friction": VirtualFriction, "sensors": Sensors}


def _read(path: Path) -> dict[str, Any]:
    try:
        return toml_of(path)
    except OSError as error:
        names = ", ".join(sorted(file.stem for file in FOLDER.glob("*.toml")))
        raise IdentificationError(
            f"'{path}' cannot be read ({error.strerror}); give the TOML of a virtual robot, or a "
            f"bundled one: {names}"
        ) from None
    except ValueError as error:
        raise IdentificationError(
            f"'{path}' cannot be read as TOML ({error}); correct it"
        ) from None


def _merge(tables: dict[str, dict[str, Any]], given: dict[str, Any], name: str) -> None:
    for table, entries in given.items():
        _require_known(table, tables, f"'{name}' has the unknown table [{table}]")
        if not isinstance(entries, dict):
            raise IdentificationError(
                f"'{name}': {table} expects a table, got {entries!r}; write [{table}] "
                "above its entries"
            )
        for key, value in entries.items():
            _require_known(key, tables[table], f"'{name}' has the unknown key [{table}] {key}")
            tables[table][key] = value


def _require_known(word: str, known: Mapping[str, Any], fault: str) -> None:
    if word in known:
        return
    near = difflib.get_close_matches(word, known, n=1)
    hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
    raise IdentificationError(f"{fault}; {hint}")


def _numbers(table: str, key: str, value: Any, lib: Library) -> Array:
    """One number or n of them, as (n,)."""
    items = np.ravel(np.asarray(value, dtype=object)).tolist()
    real = all(isinstance(x, int | float) and not isinstance(x, bool) for x in items)
    array = np.array(items, dtype=float) if real else np.array([np.nan])
    least = -np.inf if key in _ANY_SIGN else 0.0
    positive = key in _ABOVE_ZERO
    fits = array.size in {1, lib.n_joints}
    if not (np.isfinite(array) & ((array > 0) if positive else (array >= least))).all() or not fits:
        bound = "above 0" if positive else "finite" if key in _ANY_SIGN else "from 0 up"
        raise IdentificationError(
            f"[{table}] {key} expects one number {bound}, or one for each of the {lib.n_joints} "
            f"joints, got {value!r}"
        )
    return np.array(np.broadcast_to(array, (lib.n_joints,)))


def _single(table: str, key: str, values: Array) -> float:
    if np.ptp(values) > 0:
        raise IdentificationError(f"[{table}] {key} expects one number, got {values.tolist()}")
    return float(values[0])


def _law(value: Any) -> str:
    if value not in LAWS:
        raise IdentificationError(
            f"[controller] law expects one of {', '.join(LAWS)}, got {value!r}"
        )
    return str(value)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


def by_limits(lib: Library) -> dict[str, dict[str, Any]]:
    """Plausible tables for any robot, from effort and velocity limits.

    Shares of the largest torque that geared joints with torque sensors have, rounded. A joint
    without an effort limit is assumed to lift three times what it carries, and to accelerate it
    with 20 rad/s²; without a velocity limit to turn with π rad/s.
    """
    limits = lib.limits()
    effort = np.where(np.isfinite(limits["effort"]), limits["effort"], _strength(lib))
    speed = np.where(np.isfinite(limits["velocity"]), limits["velocity"], np.pi)
    turning = np.array([joint.unit == "rad" for joint in lib.manifest.joints])
    coulomb = 0.01 * effort
    return {
        "inertia": {"spread": 0.02, "rotor": effort / 250},
        "friction": {
            "coulomb": coulomb,
            "asymmetry": 0.1,
            "stribeck": 0.25,
            "stribeck_speed": 0.05 * speed,
            "viscous": 0.5 * coulomb / speed,
            "load": 0.005,
            "ripple": 0.06,
            "ripple_waves": np.where(turning, 8.0, 80.0),
            "ripple_phase": np.arange(lib.n_joints),
            "dahl_stroke": np.where(turning, 2e-3, 2e-4),
        },
        "sensors": {
            "position_quantum": np.where(turning, 1e-5, 1e-6),
            "position_noise": np.where(turning, 5e-6, 5e-7),
            "velocity_cutoff_hz": 100.0,
            "torque_gain": 0.003,
            "torque_bias": 0.002 * effort,
            "torque_noise": 0.001 * effort,
            "torque_quantum": 1e-4 * effort,
        },
        "drive": {"delay_s": 0.001, "step_s": 2.5e-4},
        "controller": {
            "law": LAWS[0],
            "stiffness": 225.0,
            "damping": 30.0,
            "rate_hz": 1000.0,
        },
    }


def _strength(lib: Library) -> Array:
    """Torque of joints without an effort limit, (n,); from 100 fixed poses within reach."""
    limits = lib.limits()
    low = np.where(np.isfinite(limits["lower"]), limits["lower"], lib.home - np.pi)
    high = np.where(np.isfinite(limits["upper"]), limits["upper"], lib.home + np.pi)
    q = low + (high - low) * np.random.default_rng(0).uniform(size=(100, lib.n_joints))
    weight = np.abs(lib.bias_forces(q, np.zeros_like(q), lib.pi0)).max(axis=0)
    inertia = np.diagonal(lib.mass_matrix(q, lib.pi0), axis1=1, axis2=2).max(axis=0)
    return np.asarray(np.maximum(3 * weight, 20 * inertia))
