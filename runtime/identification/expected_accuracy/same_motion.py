"""Gain of continuing a motion whose samples are there: the information grows in proportion."""

import numpy as np

from runtime.estimators.convex import reduce
from runtime.estimators.regression import Statistics
from runtime.identification.expected_accuracy.expected import Knowledge, expected
from runtime.identification.expected_accuracy.gain_of_recording import GainOfRecording, gained
from runtime.library import Library


def gained_by_same_motion(
    lib: Library, statistics: Statistics, known: Knowledge, grown: float, seconds: float
) -> GainOfRecording:
    """Gain of further samples of the same motion.

    Args:
        lib: library of the robot.
        statistics: factor of the samples so far.
        known: prior and present parameters.
        grown: information after the further samples over that of now.
        seconds: further recording time, s.

    Returns:
        Gain of every link, centre of mass, inertia and base parameter.
    """
    unit = max(reduce(statistics, lib.n_joints)[0].variance, np.finfo(float).tiny)
    now, later = (expected(lib, statistics, known, u).by_name(lib) for u in (unit, unit / grown))
    return gained(now, later, seconds, "the same motion")
