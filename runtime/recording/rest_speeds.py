"""Speed and travel below which each joint rests, by the size of its range.

A joint that turns rests below 0.02 rad/s. One that slides rests below 0.02 m/s where its range is
1 m or more, and below as much less as its range is shorter: a gripper crosses 4 cm in seconds and
would rest during its motion.
"""

import numpy as np

from runtime.library import Array, Library

REST_SPEED = 0.02
"""Speed [rad/s, or m/s with a range of 1 m] below which a joint rests: above the noise of filtered
encoders, and below it Coulomb friction takes any value."""
STILL = 1e-3  # travel [rad, or m with a range of 1 m] of a joint at rest, by noise and vibration


def _sizes(lib: Library) -> Array:
    """1 of joints that turn; range over 1 m of slides, without one velocity over 1 m/s; up to 1."""
    limits = lib.limits()
    span = limits["upper"] - limits["lower"]
    size = np.where(np.isfinite(span), span, limits["velocity"])
    slides = np.array([joint.kind == "prismatic" for joint in lib.manifest.joints])
    return np.where(slides & (size > 0), np.minimum(size, 1.0), 1.0)


def rest_speeds(lib: Library) -> Array:
    """Speed below which each joint rests, (n,) [rad/s, m/s]."""
    return REST_SPEED * _sizes(lib)


def still_travels(lib: Library) -> Array:
    """Travel of each joint at rest, (n,) [rad, m]."""
    return STILL * _sizes(lib)


def as_rest_speed(lib: Library) -> float | tuple[float, ...]:
    """`rest_speed` of a recipe: one number where all joints have the same, else one per joint."""
    speeds = [float(f"{value:.6g}") for value in rest_speeds(lib)]
    return speeds[0] if len(set(speeds)) == 1 else tuple(speeds)


def shown_rest_speed(speed: float | tuple[float, ...]) -> str:
    """`rest_speed` as written in a recipe, such as "0.02" or "[0.02, 0.0008]"."""
    if isinstance(speed, tuple):
        return f"[{', '.join(f'{value:g}' for value in speed)}]"
    return f"{speed:g}"
