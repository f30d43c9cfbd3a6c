"""Logs of servo arms without torque sensors, whose links, drives, delay and bias are known.

The desired positions are chosen such that the law commands the torque of the motion, d earlier:

    q_des(t) = q(t) − b + (τ(t + d) + kd dq(t)) / kp,   τ = Y π + F φ + e

so that the log is exact for every motion, without a simulation.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from runtime.library import Array, Library
from runtime.recording import Friction, Recording, read_recording
from runtime.recording.friction.model import DRIVE, columns, torque
from runtime.recording.settings import JointMotion

KP, KD, RATE = 80.0, 2.5, 200.0
STROKE = 2e-3
"""Travel [rad] within which the friction of `dry_servo_log` turns round."""


@dataclass(frozen=True, slots=True)
class Servo:
    """Truth of one log.

    Attributes:
        delay: d, (1,) or (n,) [s].
        bias: b of q_true = q + b, (n,) [rad].
        phi: viscous, Coulomb, offset and rotor of every joint, (n, 4).
        pi: parameters of the links, (10 n,).
    """

    delay: Array
    bias: Array
    phi: Array
    pi: Array


def random_servo(lib: Library, rng: np.random.Generator) -> Servo:
    """Drives of a small arm; its links differ from the URDF by 5 %.

    Args:
        lib: library of the robot.
        rng: random generator.

    Returns:
        The truth.
    """
    n = lib.n_joints
    low, high = np.array([0.5, 0.3, -0.2, 0.05]), np.array([3.0, 1.5, 0.2, 0.4])
    return Servo(
        delay=rng.uniform(0.0, 0.06, size=1),
        bias=rng.uniform(-0.02, 0.02, size=n),
        phi=rng.uniform(low, high, size=(n, 4)),
        pi=lib.pi0 * (1 + 0.05 * np.repeat(rng.normal(size=n), 10)),
    )


def servo_arrays(
    lib: Library,
    servo: Servo,
    rng: np.random.Generator,
    *,
    seconds: float = 20.0,
    noise: float = 0.1,
    fastest_hz: float = 1.5,
) -> dict[str, Array]:
    """Arrays of the NPZ of a log.

    Args:
        lib: library of the robot.
        servo: its truth.
        rng: random generator.
        seconds: duration [s].
        noise: standard deviation of the torque, white over the rows [N·m].
        fastest_hz: highest frequency of the motion [Hz].

    Returns:
        t, q, dq, q_des, dq_des, kp, kd, and tau_true without noise at the instants of t.
    """
    n = lib.n_joints
    t = np.arange(0.0, seconds, 1 / RATE)
    f = np.linspace(0.1, fastest_hz, 6)[:, None]
    phase = rng.uniform(0, 2 * np.pi, size=(6, n))
    size = 0.25 / np.sqrt(f) * rng.uniform(0.5, 1.0, size=(6, n)) / 3
    middle = rng.uniform(-0.3, 0.3, size=n) + np.array([0, 0.3, 0, -1.5, 0, 1.5, 0])[:n]

    def motion(at: Array) -> tuple[Array, Array, Array]:
        w = 2 * np.pi * f[:, :, None]
        angle = w * at + phase[:, :, None]
        wave = size[:, :, None] * np.cos(angle)
        slope = -size[:, :, None] * w * np.sin(angle)
        return ((middle[:, None] + wave.sum(0)).T, slope.sum(0).T, -(w**2 * wave).sum(0).T)

    def required(at: Array) -> Array:
        q, dq, ddq = motion(at)
        terms = columns(JointMotion(dq, q, ddq, lib), Friction(DRIVE))
        return np.asarray(lib.inverse_dynamics(q, dq, ddq, servo.pi) + torque(terms, servo.phi))

    q, dq, _ = motion(t)
    late = np.broadcast_to(servo.delay, (n,))
    tau = np.stack([required(t + late[j])[:, j] for j in range(n)], axis=1)
    commanded = tau + noise * rng.normal(size=tau.shape)
    q_des = q - servo.bias + (commanded + KD * dq) / KP
    return {
        **{"t": t, "q": q - servo.bias, "dq": dq, "q_des": q_des, "dq_des": np.zeros_like(q)},
        **{"kp": np.full(n, KP), "kd": np.full(n, KD), "tau_true": required(t)},
    }


def dry_servo_log(
    lib: Library,
    folder: Path,
    memory: bool,
    slope: float,
    strokes: float | tuple[float, ...] = STROKE,
    load: float = 0.0,
) -> tuple[Recording, Servo]:
    """Log of drives without delay whose dry friction has a memory, or changes with the position.

    Args:
        lib: library of the robot.
        folder: where log.npz is written.
        memory: whether the friction is that of the column dahl instead of coulomb.
        slope: coefficient of the column position [N·m].
        strokes: of the memory, of all joints or of each [rad].
        load: coefficient of the column load, or dahl_load.

    Returns:
        The log as read, and its truth.
    """
    rng = np.random.default_rng(0)
    usual = random_servo(lib, rng)
    servo = replace(usual, delay=np.zeros(1), bias=np.zeros(lib.n_joints), pi=lib.pi0)
    arrays = servo_arrays(lib, servo, rng, seconds=12.0, noise=0.02)
    motion = JointMotion(arrays["dq"], arrays["q"], lib=lib)
    plain = columns(motion, Friction(("coulomb", "position", "load")))
    names = ("dahl", "position", "dahl_load")
    kept = columns(motion, Friction(names, dahl_stroke=strokes)) if memory else plain
    change = servo.phi[:, 1] * (kept - plain)[..., 0] + slope * kept[..., 1] + load * kept[..., 2]
    arrays["q_des"] = arrays["q_des"] + change / KP
    logged = {key: values for key, values in arrays.items() if key != "tau_true"}
    np.savez(folder / "log.npz", **logged)  # type: ignore[arg-type]
    return read_recording(folder / "log.npz"), servo
