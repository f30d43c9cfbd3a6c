"""Closed-loop description of a log: controller, rotors and reference, as TOML.

    [controller]
    stiffness = 225.0          # K_p, 1/s²: one number, or one per joint
    damping = 30.0             # K_d, 1/s
    rotor = 0.1                # inertia of the motors, reflected to the joints, kg·m²
    rate_hz = 1000.0

    [reference]
    trajectory = "motion.json" # of `excite`, relative to this file
    start = 0.0                # when it began, s of the log's clock

The controller is computed torque with the URDF's model. IDIM-IV and DIDIM simulate it.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.excitation.trajectory_file import read_trajectory
from runtime.files import replacing, toml_of
from runtime.library import Array, Library
from runtime.recording import Recording
from runtime.simulation import Controller, Plant, follow, per_joint, sample_times

_KEYS: dict[str, dict[str, tuple[type, ...]]] = {
    "controller": dict.fromkeys(("stiffness", "damping", "rotor"), (int, float, list))
    | {"rate_hz": (int, float)},
    "reference": {"trajectory": (str,), "start": (int, float)},
}


@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """Closed-loop description: how the robot was moved.

    Attributes:
        reference: requested motion.
        controller: gains and model of the controller.
        rotor: inertia of the motors, (n,) or one number, kg·m².
        rate_hz: rate of the controller, Hz.
        start: beginning of the reference, s of the recording's clock.
    """

    reference: Trajectory
    controller: Controller = field(default_factory=Controller)
    rotor: Array | float = 0.1
    rate_hz: float = 1000.0
    start: float = 0.0

    def simulate(self, lib: Library, pi: Array, friction: dict[str, Array], t: Array) -> Recording:
        """Simulated recording of a robot with these parameters, without noise."""
        clock = sample_times(self.reference.duration, self.rate_hz)
        since = np.asarray(t) - self.start
        slack = 0.5 / self.rate_hz
        if since[0] < -slack or since[-1] > clock[-1] + slack:
            raise IdentificationError(
                f"the recording goes from {t[0]:.3f} to {t[-1]:.3f} s, the reference from "
                f"{self.start:.3f} to {self.start + clock[-1]:.3f} s; cut the recording, or "
                "correct the start and the trajectory of the controller file"
            )
        reference = np.stack(self.reference.at(lib, clock)[:3], axis=1)
        plant = Plant(pi, rotor=self.rotor, **friction)  # type: ignore[arg-type]
        motion = follow(lib, reference, plant, self.controller, self.rate_hz)

        def at(values: Array) -> Array:
            return np.stack([np.interp(since, clock, column) for column in values.T], axis=1)

        return Recording(
            t,
            at(motion.q),
            at(motion.dq),
            at(motion.ddq),
            at(motion.link),
            name="simulated",
            joint_names=lib.joint_names,
        )


def read_controller(path: Path, lib: Library) -> ClosedLoop:
    """Read a controller file."""
    try:
        facts = toml_of(path)
    except (OSError, ValueError) as error:
        raise IdentificationError(
            f"'{path}' cannot be read as a TOML file "
            f"({getattr(error, 'strerror', None) or error}); a controller file has "
            "[controller] stiffness, damping, rotor, rate_hz and [reference] trajectory, start"
        ) from None
    _require_known(facts, path)
    controller, reference = dict(facts.get("controller", {})), facts.get("reference", {})
    if "trajectory" not in reference:
        raise IdentificationError(
            f"'{path}' lacks the [reference] trajectory; give the JSON of: python -m runtime excite"
        )
    motion = Path(reference["trajectory"])
    if motion.is_absolute() or ".." in motion.parts:
        raise IdentificationError(
            f"'{path}' names the trajectory '{motion}', which does not lie beside it; move it there"
        )
    n = lib.n_joints
    try:
        rate = float(controller.pop("rate_hz", 1000.0))
        start = float(reference.get("start", 0.0))
        gains = {
            key: per_joint(n, value, f"{key} in '{path}'") for key, value in controller.items()
        }
    except (TypeError, ValueError, OverflowError):
        rate, start, gains = 0.0, 0.0, {}
    numbers = np.concatenate([*gains.values(), [rate, abs(start)]])
    if not (np.isfinite(numbers) & (numbers >= 0)).all() or rate == 0:
        raise IdentificationError(f"'{path}' needs gains, rotors and a rate_hz above 0")
    rotor = gains.pop("rotor", 0.1)
    return ClosedLoop(
        read_trajectory(path.parent / motion, lib),
        Controller(**gains),  # type: ignore[arg-type]
        rotor,
        rate,
        start,
    )


def write_controller(closed_loop: ClosedLoop, trajectory: str, path: Path) -> None:
    """Write a controller file, atomically."""
    lines = ["[controller]"]
    values = {
        "stiffness": closed_loop.controller.stiffness,
        "damping": closed_loop.controller.damping,
        "rotor": closed_loop.rotor,
        "rate_hz": closed_loop.rate_hz,
    }
    lines += [f"{key} = {np.asarray(value, dtype=float).tolist()}" for key, value in values.items()]
    lines += ["", "[reference]", f'trajectory = "{trajectory}"', f"start = {closed_loop.start}"]
    with replacing(path) as file:
        file.write(("\n".join(lines) + "\n").encode())


def _require_known(facts: dict[str, Any], path: Path) -> None:
    for table, entries in facts.items():
        known = _KEYS.get(table, {})
        for key, value in entries.items() if isinstance(entries, dict) else [("", None)]:
            if key not in known or not isinstance(value, known[key]) or isinstance(value, bool):
                named = f"[{table}] {key}".strip()
                raise IdentificationError(
                    f"'{path}': a controller file does not accept {named} = {value!r}; it has "
                    "[controller] stiffness, damping, rotor, rate_hz and [reference] trajectory, "
                    "start"
                )
