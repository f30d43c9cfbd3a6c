"""`observe` on robots of a simulator that shares no code with this one: false alarms and pushes.

The simulator is `prototypes/foreign_plant.py` below $SYMGEN_DATA (default ../shared): arms off
their URDF, LuGre friction with load, warmth and ripple, cables, sessions that differ, coloured
noise. An arm is identified from three motions of one day and calibrated on half an hour of another;
every log that is observed is another motion on another day. Finished arms are lines of a file.
"""

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from bench.fleet import joined
from bench.front import ROOT
from bench.monitoring import STATED, known_of, pushed, resumed, stated
from runtime import Recording
from runtime.library import Library
from runtime.monitoring.calibration import calibrated, calibrated_on, rate_interval
from runtime.monitoring.observation import detector_for, observation_of, prepared_for, signals_of

LOG_S, RATE_HZ = 20.0, 100.0
TRAINING, CALIBRATION, OBSERVED = 3, 90, 900
"""Logs per robot: identified, half an hour to calibrate, five hours that are observed."""
PUSH, PUSH_S, WITHIN_S = 0.06, 0.5, 0.05
"""Size of a push as a share of the joint's limit, its length, and the time to find it [s]."""
PUSHES = np.arange(3.0, 18.0, 1.5)
"""Instants of pushes in every `EVERY`-th log [s]."""
EVERY = 20


def plant() -> ModuleType:
    """The simulator, read from where it is."""
    folder = Path(os.environ.get("SYMGEN_DATA") or ROOT.parent / "shared")
    file = folder / "prototypes/foreign_plant.py"
    module = ModuleType("foreign_plant")
    exec(compile(file.read_text(encoding="utf-8"), str(file), "exec"), module.__dict__)  # noqa: S102
    return module


def observed(lib: Library, robots: int, done: Path) -> list[list[Any]]:
    """Per robot: number, hours, alarms by rate, pushes, missed ones, interval of 1 per hour."""
    rows = resumed(
        done, [(k,) for k in range(robots)], lambda wanted: (_robot(lib, *each) for each in wanted)
    )
    return [[seed, *row] for seed, row in enumerate(rows)]


def _robot(lib: Library, seed: int) -> list[Any]:
    arm = plant().Arm(str(ROOT / f"symgen/robots/{lib.name}.urdf"), seed=seed)

    def logs(first: int, count: int, day: int | None = None) -> Iterator[Recording]:
        for k in range(first, first + count):
            motion = 10_000 * seed + k  # of this robot alone
            log, _ = arm.session(k if day is None else day, motion, LOG_S, RATE_HZ)
            yield Recording(
                np.arange(len(log["q"])) / RATE_HZ, log["q"], log["dq"], None, log["tau"],
                joint_names=lib.joint_names,
            )  # fmt: skip

    one, two, three = logs(0, TRAINING, day=0)
    known = known_of(lib, joined(joined(one, two), three))
    free = [prepared_for(log, known.model) for log in logs(1000, CALIBRATION, day=1)]
    free = [prepared_for(log, known.model, free[0].rate_hz) for log in free]
    root = known.posterior.of_readings().root(lib)
    detector = detector_for(lib, known.model, free[0], known.held_out, stated(1.0), None, root)
    detector, tails = calibrated_on(lib, detector, free)
    by_rate = [calibrated(replace(detector, rate=stated(rate)), tails) for rate in STATED]
    seconds, alarms, pushes, missed = 0.0, np.zeros(len(STATED), int), 0, 0
    for k, log in enumerate(logs(5000, OBSERVED)):
        data = prepared_for(log, known.model, free[0].rate_hz)
        signals = signals_of(lib, detector, data)
        seen = [observation_of(lib, each, signals) for each in by_rate]
        seconds += seen[0].seconds
        alarms += [len(each.contacts) for each in seen]
        if k % EVERY == 0:
            joints, sizes = [(k // EVERY + i) % 7 for i in range(len(PUSHES))], PUSH * arm.size
            within = (-0.01, WITHIN_S)
            found = pushed(lib, by_rate[0], data, PUSHES, joints, sizes, PUSH_S, within)
            pushes, missed = pushes + len(PUSHES), missed + found.count(False)
    low, high = rate_interval(tails, by_rate[0].levels)
    return [seconds / 3600, alarms.tolist(), pushes, missed, [3600 * low, 3600 * high]]
