"""`manifest.json`: the contract between what was generated and what runs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import json_of
from runtime.common.records import record_from_table
from runtime.common.user_builds import NAME
from runtime.errors import LibraryError
from runtime.library.arrays import Array
from runtime.library.parameters import PI_NAMES

FORMAT = 4


@dataclass(frozen=True, slots=True)
class ArgumentFacts:
    """Name, shape and unit of a kernel's input or output; `summed` over a batch or not."""

    name: str
    shape: tuple[int, ...]
    unit: str
    summed: bool = False
    shared: bool = False
    size: int = 0  # number of entries

    def __post_init__(self) -> None:
        # Every call of a kernel needs it several times.
        object.__setattr__(self, "size", math.prod(self.shape))


@dataclass(frozen=True, slots=True)
class KernelFacts:
    """One kernel as the manifest describes it."""

    name: str
    per: str
    equation: str
    inputs: tuple[ArgumentFacts, ...]
    outputs: tuple[ArgumentFacts, ...]
    operations: int


@dataclass(frozen=True, slots=True)
class JointFacts:
    """Name, kind, moved link, unit and limits of a joint (None without), and where it stands.

    Its frame, that of the link it moves, lies in the frame of joint `parent` (−1: the base) with
    the axes R = `rotation` and the origin `translation` [m] at q = 0; `axis` is in its own frame.
    """

    name: str
    kind: str
    link: str
    unit: str
    lower: float | None
    upper: float | None
    velocity: float | None
    effort: float | None
    parent: int
    rotation: tuple[tuple[float, ...], ...]
    translation: tuple[float, ...]
    axis: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class CouplingFacts:
    """q_all = A q + b: `matrix` A (N, n), `offset` b (N,) [rad, m], `independent` (n,) indices."""

    independent: tuple[int, ...]
    matrix: Array
    offset: Array


@dataclass(frozen=True, slots=True)
class ProxyFacts:
    """A capsule rigid in `link` ("base": the fixed one), m; `joint` moves it, −1 for the base."""

    name: str
    link: str
    joint: int
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float


@dataclass(frozen=True, slots=True)
class PairFacts:
    """Names of two proxies and the distance that they must keep, m."""

    first: str
    second: str
    margin: float


@dataclass(frozen=True, slots=True)
class BrakingFacts:
    """Velocity limits that shrink towards the ends of the range; (n,) each.

    max(0, dq + c)² ≤ k (upper − q) and max(0, c − dq)² ≤ k (q − lower), convex in (q, dq).
    """

    k: Array
    c: Array
    upper: Array
    lower: Array


@dataclass(frozen=True, slots=True)
class FrameFacts:
    """A frame rigid in that of a moving link: R (3, 3) to the link's axes, origin [m]."""

    link: str
    rotation: tuple[tuple[float, ...], ...]
    translation: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class LoopJointFacts:
    """A loop joint: two frames that coincide but for what its kind leaves free about their z."""

    kind: str
    parent: FrameFacts
    child: FrameFacts


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """The facts of one robot, see the fields of `manifest.json`.

    `joints`: the independent ones; `all_joints`: one per moving link, which `parent` counts by.
    `coupling`: None where they are the same. `loops`: names of the closed loops, whose kernels take
    the place of `coupling`; `loop_joints`: their frames, in the same order. `friction_coordinates`:
    name → row (n,) of coordinates beside the joints at whose speed friction acts. `springs`: names
    of those of unknown stiffness.
    `assumed`: link → "given mass" or "placeholder", where the URDF states no <inertial>.
    `floating`: the base is free, and the first of `all_joints` is its joint. `omitted`: kernel that
    the robot does not have → what to use instead. `mount`: flange of a robot whose tip is a part of
    the tool that its file contains; None where it is the tip.
    """

    robot: str
    model_hash: str
    versions: dict[str, str]
    base: str
    tip: str
    tip_frame: FrameFacts
    mount: str | None = None
    mount_frame: FrameFacts | None = None
    gravity: tuple[float, ...]
    joints: tuple[JointFacts, ...]
    all_joints: tuple[JointFacts, ...]
    coupling: CouplingFacts | None = None
    loops: tuple[str, ...] = ()
    loop_joints: tuple[LoopJointFacts, ...] = ()
    friction_coordinates: dict[str, tuple[float, ...]] = field(default_factory=dict)
    springs: tuple[str, ...] = ()
    home: tuple[float, ...]
    acceleration: tuple[float, ...] | None
    jerk: tuple[float, ...] | None
    torque_rate: tuple[float, ...] | None
    tip_speed: float | None
    braking: BrakingFacts | None
    proxies: tuple[ProxyFacts, ...]
    pairs: tuple[PairFacts, ...]
    moving_proxies: tuple[str, ...]
    lumped: tuple[dict[str, Any], ...]
    pi0: tuple[float, ...]
    lam0: tuple[float, ...]
    base_columns: tuple[int, ...]
    base_matrix: tuple[tuple[float, ...], ...]
    kernels: dict[str, KernelFacts]
    assumed: dict[str, str] = field(default_factory=dict)
    floating: bool = False
    omitted: dict[str, str] = field(default_factory=dict)


def read_manifest(path: Path) -> Manifest:
    """Read and check a manifest."""
    again = "run: python -m symgen build"
    try:
        raw = json_of(path)
    except OSError:
        raise LibraryError(f"'{path.parent}' holds no manifest.json; {again}") from None
    except ValueError:
        raise LibraryError(f"'{path}' is damaged (not JSON); {again}") from None
    try:
        if raw["format"] != FORMAT or tuple(raw["pi_names"]) != PI_NAMES:
            raise LibraryError(
                f"'{path}' has the format {raw['format']}, expected {FORMAT}; {again}"
            )
        if not NAME.fullmatch(raw["robot"]):
            raise TypeError("robot")  # it becomes part of paths
        joints, base = raw.get("all_joints", raw["joints"]), raw["base_parameters"]
        places = {joint["link"]: k for k, joint in enumerate(joints)}
        brakes = raw["braking"]
        facts = raw | {
            "all_joints": joints,
            "coupling": _coupling(raw["coupling"]) if "coupling" in raw else None,
            "braking": BrakingFacts(**{k: np.array(v) for k, v in brakes.items()})
            if brakes
            else None,
            "proxies": [each | {"joint": places.get(each["link"], -1)} for each in raw["proxy"]],
            "pairs": raw["pair"],
            "base_columns": base["columns"],
            "base_matrix": base["matrix"],
            "kernels": {entry["name"]: entry for entry in raw["kernels"]},
        }
        facts |= {key: facts[key] or None for key in ("acceleration", "jerk", "torque_rate")}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise LibraryError(f"'{path}' is damaged (no valid {error}); {again}") from None
    try:
        return record_from_table(Manifest, facts, "its table", LibraryError)
    except LibraryError as error:
        raise LibraryError(f"'{path}' is damaged ({error}); {again}") from None


def _coupling(entry: dict[str, Any]) -> CouplingFacts:
    matrix, offset = np.array(entry["matrix"], dtype=float), np.array(entry["offset"], dtype=float)
    independent = tuple(int(k) for k in entry["independent"])
    if matrix.shape != (len(offset), len(independent)):
        raise ValueError("coupling")
    return CouplingFacts(independent, matrix, offset)


def torque_units(manifest: Manifest) -> tuple[str, ...]:
    """Unit of the torque of every joint, "N·m" or "N", (n,)."""
    return tuple("N" if joint.kind == "prismatic" else "N·m" for joint in manifest.joints)


def file_units(manifest: Manifest) -> list[str]:
    """The same as written in files, "N*m" or "N"."""
    return [unit.replace("·", "*") for unit in torque_units(manifest)]


def common_unit(units: Sequence[str], prefix: str = "") -> str:
    """Unit of a number over several joints."""
    return "|".join(prefix + unit for unit in dict.fromkeys(units))


def listed_torques(values: Array, units: Sequence[str], digits: str, prefix: str = "") -> str:
    """Torques of several joints as text."""
    numbers = [f"{value:{digits}}" for value in values]
    if len(set(units)) == 1:
        return f"{', '.join(numbers)} {prefix}{units[0]}"
    return ", ".join(f"{n} {prefix}{unit}" for n, unit in zip(numbers, units, strict=True))
