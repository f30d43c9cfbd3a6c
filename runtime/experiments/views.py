"""The views that several studies have, told by what differs."""

from runtime.experiments.study import View

TORQUE = tuple(f"tau_error_{joint}" for joint in range(1, 8))
"""Lines of the document's tables of torque errors."""
MOTION = ("t", "q", "dq", "ddq", "tau")
"""Curves of a motion, each behind the motion's prefix."""


def torque_table(name: str, title: str, cases: tuple[str, ...]) -> View:
    """Torque error of every joint."""
    return View(name, "table", f"{title}: torque errors, %", cases, TORQUE)


def torque_bars(name: str, title: str, cases: tuple[str, ...]) -> View:
    """Torque error of every joint, the methods side by side."""
    return View(name, "bars", title, cases, TORQUE, axes=("joint", "torque error [%]"))


def motion(name: str, title: str, prefix: str) -> View:
    """A motion under the names that `motions.curves` gives it."""
    series = tuple(f"{prefix}_{key}" for key in MOTION)
    return View(name, "motion", title, series=series, axes=("time [s]", ""))
