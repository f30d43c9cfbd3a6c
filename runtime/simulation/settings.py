"""Settings of a virtual robot beside its inertia: rotors, friction, sensors, drive, controller.

    [inertia]     spread (of the truth about the model), rotor [kg·m²]
    [friction]    see `runtime.simulation.virtual_robot`
    [sensors]     quanta, noise, bias, gain; see `runtime.simulation.virtual_robot`
    [drive]       delay_s of the torque, step_s of the engine
    [controller]  law, stiffness K_p [1/s²], damping K_d [1/s], rate_hz

Every entry is one number, or where it belongs to joints one per joint. Entries that no file states
follow from the limits of the robot, so that every robot has plausible settings.
`simulation/robots/NAME.toml` is used for the robot of that name; a user's file replaces single
entries of it.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from runtime.common.records import (
    NotNegative,
    PerJoint,
    Positive,
    Record,
    record_from_table,
    record_from_toml,
)
from runtime.errors import IdentificationError
from runtime.library import Array, Library
from runtime.simulation.plant import per_joint

FOLDER = Path(__file__).parent / "robots"
_WHOLE = 1e-6  # relative tolerance of a number of steps, for the rounding of decimals


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


_ABOVE_ZERO = Meta(description="one number above 0, or one per joint")
_EACH_ABOVE_ZERO = Annotated[Positive | tuple[Positive, ...], _ABOVE_ZERO]
_EACH_REAL = Annotated[float | tuple[float, ...], Meta(description="one number, or one per joint")]
_KINDS: dict[str, dict[str, Any]] = {
    "inertia": {
        # exp(±1) on every principal moment is more than manufacturing leaves.
        "spread": Annotated[
            float, Meta(ge=0, le=1, description="one number from 0 to 1 (0.02 is usual)")
        ],
        "rotor": _EACH_ABOVE_ZERO,
    },
    "friction": dict.fromkeys((each.name for each in fields(VirtualFriction)), PerJoint)
    | {"stribeck_speed": _EACH_ABOVE_ZERO, "dahl_stroke": _EACH_ABOVE_ZERO}
    | {"ripple_phase": _EACH_REAL},
    "sensors": dict.fromkeys((each.name for each in fields(Sensors)), PerJoint)
    | {"velocity_cutoff_hz": _EACH_ABOVE_ZERO},
    "drive": {"delay_s": NotNegative, "step_s": Positive},
    "controller": {
        "law": Literal["computed_torque", "feedforward"],
        "stiffness": PerJoint,
        "damping": PerJoint,
        "rate_hz": Positive,
    },
}
_FILE = msgspec.defstruct(  # the whole file: tables and their keys
    "VirtualRobotFile",
    [
        (table, msgspec.defstruct(table, [*keys.items()], bases=(Record,), frozen=True))
        for table, keys in _KINDS.items()
    ],
    bases=(Record,),
    frozen=True,
)


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
        values = {**asdict(self), **asdict(self.friction), **asdict(self.sensors)}
        return {table: {key: _plain(values[key]) for key in keys} for table, keys in _KINDS.items()}

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
    if chosen and not chosen[-1].is_file():
        names = ", ".join(sorted(file.stem for file in FOLDER.glob("*.toml")))
        raise IdentificationError(
            f"'{path}' cannot be read (it is no file); give the TOML of a virtual robot, or a "
            f"bundled one: {names}"
        )
    where = "the settings"
    for file in chosen:
        where = f"'{file.name}'"
        given = record_from_toml(dict[str, dict[str, Any]], file, where, IdentificationError)
        tables |= {table: tables.get(table, {}) | given[table] for table in given}
    return settings_from(tables, lib, where)


def settings_from(
    tables: Mapping[str, Mapping[str, Any]], lib: Library, where: str = "the settings"
) -> VirtualRobotSettings:
    """Settings from complete tables."""
    plain = {table: {k: _plain(v) for k, v in keys.items()} for table, keys in tables.items()}
    stated = msgspec.to_builtins(record_from_table(_FILE, plain, where, IdentificationError))

    def each(table: str, *keys: str) -> dict[str, Any]:
        values = stated[table]
        return {k: per_joint(lib.n_joints, values[k], f"[{table}] {k}") for k in keys or values}

    rest = stated["inertia"] | stated["drive"] | stated["controller"]
    rest |= each("inertia", "rotor") | each("controller", "stiffness", "damping")
    friction, sensors = VirtualFriction(**each("friction")), Sensors(**each("sensors"))
    made = VirtualRobotSettings(friction, sensors, **rest)
    periods = (("a period of the controller", 1 / made.rate_hz, 1), ("delay_s", made.delay_s, 0))
    for name, seconds, least in periods:
        steps = seconds / made.step_s
        whole = round(min(steps, 1e300))  # a step near 0 goes into it infinitely often
        if steps > 1e300 or abs(steps - whole) > _WHOLE * max(steps, 1.0) or whole < least:
            raise IdentificationError(
                f"[drive] step_s of {made.step_s:g} s does not go into {name} of {seconds:g} s a "
                "whole number of times; change one of them"
            )
    return made


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
            "law": "computed_torque",
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
