"""Observer on the virtual FR3: false alarms in free motion, and pushes that are found in time.

The model is identified from `TRAINING` motions of 10 s with the default friction model, and
thresholds are fitted to `CALIBRATION` further ones. Every log is another motion, drawn within the
limits, with its own noise. Finished logs are lines of a file, so that a run that was interrupted
continues.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from bench.compiled_plant import record
from bench.fleet import joined
from bench.monitoring import FILTERED, saved_of, stated
from runtime import Recording, choose_default_friction, identify
from runtime.excitation import Trajectory
from runtime.library import Library
from runtime.monitoring.calibration import calibrated, tails_of
from runtime.monitoring.model import model_of
from runtime.monitoring.noise import read_held_out
from runtime.monitoring.observation import (
    Detector,
    detector_for,
    observation_of,
    observe,
    prepared_for,
    signals_of,
)

Array = NDArray[np.float64]

TRAINING, FIRST_SEED = 6, 100_000
"""Number of training motions, and the seed of the first one that is drawn."""
CALIBRATION, CALIBRATION_SEED = 180, 200_000
"""The same of motions without contacts to which thresholds are fitted: half an hour."""
PUSH = (3.0, 3.0, 3.0, 3.0, 1.0, 1.0, 1.0)
"""Size of the pushes, N·m."""
WITHIN_S, PERIOD_S, LENGTH_S = 0.02, 0.5, 0.25
"""Time within which a push has to be found, time between two pushes, and their length, s."""
USED = 0.95
"""Share of the limits of speed and acceleration that a drawn motion may use."""
STATED = (1.0, 10.0, 100.0)
"""Stated rates of false alarms, 1/h; pushes are counted at `AT`, one of them."""
AT = 1.0


@dataclass(frozen=True, slots=True)
class Seen:
    """Alarms and pushes."""

    hours: float  # of free motion
    alarms: dict[float, int]  # stated rate [1/h] → alarms that were counted
    pushes: int  # number of pushes
    missed: tuple[int, ...]  # joint of every push that was not found in time, from 1


def seen_by_observer(
    lib: Library, designs: tuple[Trajectory, ...], logs: int, pushed_logs: int, done: Path
) -> Seen:
    """Count alarms and pushes on motions that were not in the training."""
    lines = done.read_text().splitlines() if done.exists() else []
    known = {line[0]: line[1:] for line in map(json.loads, lines)}
    if any(k not in known for k in range(logs)):
        for k, row in _watched(
            lib, designs, [k for k in range(logs) if k not in known], pushed_logs
        ):
            known[k] = row
            with done.open("a") as file:
                file.write(json.dumps([k, *row]) + "\n")
    rows = [known[k] for k in range(logs)]
    hits = [hit for row in rows for hit in row[2]]
    return Seen(
        sum(row[0] for row in rows) / 3600,
        {rate: sum(row[1][k] for row in rows) for k, rate in enumerate(STATED)},
        len(hits),
        tuple(j + 1 for j, is_found in hits if not is_found),
    )


def _watched(
    lib: Library, designs: tuple[Trajectory, ...], wanted: list[int], pushed_logs: int
) -> Iterator[tuple[int, list[object]]]:
    """Number of a log; its seconds, alarms by rate, and joint and success of its pushes."""
    log = record(lib, designs[0], seed=FIRST_SEED).recording
    for k in range(1, TRAINING):
        motion = designs[1] if k == 1 else drawn_motion(lib, designs, FIRST_SEED + k)
        log = joined(log, record(lib, motion, seed=FIRST_SEED + k).recording, 0.5)
    terms = choose_default_friction(log, lib, FILTERED).terms
    result = identify(log, lib, preparation=FILTERED, friction_columns=terms, refit=True)
    with TemporaryDirectory() as folder:
        known = saved_of(lib, result, Path(folder))
        model = model_of(known.saved, lib)
        held_out = read_held_out(Path(folder), model)
    root = known.posterior.root(lib)

    def free(k: int) -> Recording:
        return prepared_for(record(lib, drawn_motion(lib, designs, k), seed=k + 1).recording, model)

    first = free(CALIBRATION_SEED)
    plain = [
        detector_for(lib, model, first, held_out, stated(rate), WITHIN_S, root) for rate in STATED
    ]
    # One observer for all rates: a rate changes the levels alone.
    one = plain[STATED.index(AT)]
    tails = tails_of(
        (signals_of(lib, one, free(CALIBRATION_SEED + k)) for k in range(CALIBRATION)),
        one.settings.rate_hz,
    )
    detectors = [calibrated(replace(one, rate=each.rate), tails) for each in plain]
    for k in wanted:
        data = free(k)
        signals = signals_of(lib, one, data)
        seen = [observation_of(lib, each, signals) for each in detectors]
        at = detectors[STATED.index(AT)]
        hits = pushed(lib, at, data, k) if k < pushed_logs else []
        yield k, [seen[0].seconds, [len(each.contacts) for each in seen], hits]


def drawn_motion(lib: Library, designs: tuple[Trajectory, ...], seed: int) -> Trajectory:
    """Mixture of two motions with weights of its own per joint, within the limits of the joints."""
    rng = np.random.default_rng([8, seed])
    weights = rng.uniform(-1, 1, size=(2, lib.n_joints, 1))
    motion = sum(w * d.coefficients for w, d in zip(weights, designs, strict=True))
    duration, limits = designs[0].duration, lib.limits()
    t = np.arange(0, duration, 0.01)
    q, dq, ddq, _ = Trajectory(lib.home, motion, duration).at(lib, t)
    away = q - lib.home
    scale = np.minimum.reduce(
        [
            np.ones(lib.n_joints),
            (limits["upper"] - 0.05 - lib.home) / np.maximum(away.max(axis=0), 1e-9),
            (lib.home - limits["lower"] - 0.05) / np.maximum(-away.min(axis=0), 1e-9),
            USED * limits["velocity"] / np.abs(dq).max(axis=0),
            USED * limits["acceleration"] / np.abs(ddq).max(axis=0),
        ]
    )
    return Trajectory(lib.home, motion * scale[:, None], duration)


def pushed(lib: Library, detector: Detector, data: Recording, turn: int) -> list[tuple[int, bool]]:
    """Joint of pushes that are added to a log, and whether each was found in time."""
    starts = np.arange(data.t[0] + PERIOD_S, data.t[-1] - PERIOD_S, PERIOD_S)
    joints = [(turn + k) % lib.n_joints for k in range(len(starts))]
    tau = np.array(data.tau)
    for start, j in zip(starts, joints, strict=True):
        tau[(data.t >= start) & (data.t < start + LENGTH_S), j] -= PUSH[j]
    seen = observe(lib, detector, data.replace(tau=tau))
    return [
        (j, any(c.number == j and 0 <= c.time_s - start <= WITHIN_S for c in seen.contacts))
        for start, j in zip(starts, joints, strict=True)
    ]
