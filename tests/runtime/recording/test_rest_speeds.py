"""Speed below which a joint rests, by the size of its range."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.inspection.checks import signals
from runtime.library import Library, load
from runtime.recording import Preparation, Recipe, Recording
from runtime.recording.preprocessing.segments import drop_rest
from runtime.recording.rest_speeds import as_rest_speed, rest_speeds, still_travels

Robot = Callable[[str], Library]
SPEEDS = (0.02, 0.02, 0.006, 0.02)
"""The slides of the gantry have 1.3 m and 0.3 m: 0.02 m/s per metre, up to one."""


def plunging(gantry: Library) -> Recording:
    """The short slide alone moves to and fro by 2 cm, at up to 0.0126 m/s, for 20 s."""
    t = np.arange(0, 20, 0.01)
    q, dq = np.tile(gantry.home, (len(t), 1)), np.zeros((len(t), 4))
    q[:, 2] += 0.02 * np.sin(0.2 * np.pi * t)
    dq[:, 2] = 0.02 * 0.2 * np.pi * np.cos(0.2 * np.pi * t)
    return Recording(t, q, dq, None, np.zeros_like(q))


def test_speeds_of_a_gantry(robot: Robot, tiny_built: Path) -> None:
    """Property: a short slide rests below a share of what long ones and turning joints do."""
    gantry, tiny = robot("gantry"), load(tiny_built)
    assert rest_speeds(gantry) == pytest.approx(SPEEDS)
    assert still_travels(gantry) == pytest.approx(np.array(SPEEDS) / 20)
    assert (as_rest_speed(gantry), as_rest_speed(tiny)) == (SPEEDS, 0.02)


def test_a_slow_slide_does_not_rest(robot: Robot) -> None:
    """Property: |cos| < 0.006/0.0126 for 31 % of the time; every row lay below 0.02 m/s before."""
    gantry = robot("gantry")
    (rest,) = signals.rest(plunging(gantry), Recipe(), gantry)
    assert rest.evidence["share"] == pytest.approx(2 / np.pi * np.arcsin(0.006 / 0.01257), abs=2e-3)
    assert "rest_speed = [0.02, 0.02, 0.006, 0.02] under" in rest.sentence


def test_rows_at_rest_joint_by_joint(robot: Robot) -> None:
    """Property: one speed per joint drops the same rows; another number is refused."""
    gantry = robot("gantry")
    log = plunging(gantry)
    kept = drop_rest(log, SPEEDS)
    assert np.abs(kept.required("dq")[:, 2]).min() >= 0.006
    assert len(kept) == np.sum(np.abs(log.required("dq")[:, 2]) >= 0.006)
    with pytest.raises(RecordingError, match="rest_speed expects one number or 4, got 2"):
        drop_rest(log, (0.02, 0.02))
    with pytest.raises(RecordingError, match="rest_speed expects a number above 0"):
        replace(Preparation(), rest_speed=(0.02, -1.0))
