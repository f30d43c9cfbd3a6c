"""Plausible settings of any virtual robot, from the limits of its joints."""

from typing import Any

import numpy as np

from runtime.library import Array, Library

LAWS = ("computed_torque", "feedforward")
"""Control laws; the first one where none is stated."""


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
