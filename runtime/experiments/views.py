"""Views that several studies share, apart from names and titles."""

from runtime.experiments.study import View

TORQUE = tuple(f"tau_error_{joint}" for joint in range(1, 8))
"""Rows of the tables of torque errors in the document."""
MOTION = ("t", "q", "dq", "ddq", "tau")
"""Series of a motion, without the prefix of the motion."""


def torque_table(name: str, title: str, cases: tuple[str, ...]) -> View:
    """Table of the torque errors of all joints."""
    return View(name, "table", f"{title}: torque errors, %", cases, TORQUE)


def torque_bars(name: str, title: str, cases: tuple[str, ...]) -> View:
    """Bars of the torque errors of all joints, grouped by method."""
    return View(name, "bars", title, cases, TORQUE, axes=("joint", "torque error [%]"))


def motion(name: str, title: str, prefix: str) -> View:
    """Figure of a motion, from the series of `motions.curves`."""
    series = tuple(f"{prefix}_{key}" for key in MOTION)
    return View(name, "motion", title, series=series, axes=("time [s]", ""))
