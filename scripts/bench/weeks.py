"""Watch: changes of the virtual FR3 from week to week, and how often they are seen and named.

The robot repeats two motions of 10 s, from which its model was identified, one of them every week.
Every week is simulated anew, with its own noise of encoders and torque sensors. Finished weeks are
lines of a file, so that a run that was interrupted continues.
"""

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from bench.compiled_plant import record
from bench.fleet import joined
from bench.monitoring import FILTERED, saved_of
from runtime import Recording, choose_default_friction, identify
from runtime.excitation import Trajectory
from runtime.identification.saved_result import SavedResult
from runtime.library import Library
from runtime.monitoring.drift import Verdict, verdict_of
from runtime.monitoring.model import model_of
from runtime.monitoring.noise import read_held_out
from runtime.recording.preprocessing import prepare
from runtime.simulation.box_payload import Box
from runtime.simulation.settings import settings_of

Array = NDArray[np.float64]

CHANGES = ("sensor gain", "payload", "friction", "clock", "model")
FIRST_SEED, PAUSE_S = 1000, 0.5
"""Seed of the training log, and the pause between its two motions, s."""


@dataclass(frozen=True, slots=True)
class Watched:
    """The model that is watched."""

    saved: SavedResult  # the result
    root: Array  # root of the covariance of [β; φ]
    sigma: Array  # RMS residual of its test part, (n,) [N·m]


def watched(lib: Library, designs: tuple[Trajectory, ...]) -> Watched:
    """Identify the virtual FR3 from both weekly motions, with the default friction model."""
    one, two = (
        record(lib, design, seed=FIRST_SEED + k).recording for k, design in enumerate(designs)
    )
    log = joined(one, two, PAUSE_S)
    terms = choose_default_friction(log, lib, FILTERED).terms
    result = identify(log, lib, preparation=FILTERED, friction_columns=terms, refit=True)
    with TemporaryDirectory() as folder:
        known = saved_of(lib, result, Path(folder))
        sigma = read_held_out(Path(folder), model_of(known.saved, lib)).rest.std(axis=0)
    return Watched(known.saved, known.posterior.root(lib), sigma)


def weeks(
    lib: Library, designs: tuple[Trajectory, ...], counts: dict[float, int], done: Path
) -> dict[tuple[float, str], tuple[int, int, int]]:
    """Verdicts on weekly logs of the virtual FR3 with and without a change."""
    lines = done.read_text().splitlines() if done.exists() else []
    known = {tuple(line[:3]): line[3:] for line in map(json.loads, lines)}
    model = watched(lib, designs)
    wanted = list(_wanted(counts))
    for level, change, week in wanted:
        if (level, change, week) in known:
            continue
        log, joint = changed_log(lib, designs, change, level, week)
        prepared = prepare(log, FILTERED, model.saved.friction, lib=lib)
        verdict = verdict_of(lib, model.saved, model.root, model.sigma, prepared)
        known[level, change, week] = [verdict.changed, _is_right(verdict, change, joint)]
        with done.open("a") as file:
            best = [verdict.best.group, verdict.best.where, verdict.p_value]
            file.write(json.dumps([level, change, week, *known[level, change, week], *best]) + "\n")
    logs, seen, right = Counter(), Counter(), Counter()
    for level, change, week in wanted:
        logs[level, change] += 1
        seen[level, change] += known[level, change, week][0]
        right[level, change] += known[level, change, week][1]
    return {key: (logs[key], seen[key], right[key]) for key in logs}


def _wanted(counts: dict[float, int]) -> Iterable[tuple[float, str, int]]:
    """Size, change and week, week by week, the largest size first."""
    for level in sorted(counts, reverse=True):
        for week in range(counts[level]):
            for change in ("", *CHANGES) if level == max(counts) else CHANGES:
                yield level, change, week


def _is_right(verdict: Verdict, change: str, joint: str) -> bool:
    best = verdict.best
    is_place = change != "sensor gain" or best.where == joint
    return bool(verdict.changed and best.group == change and is_place)


def changed_log(
    lib: Library, designs: tuple[Trajectory, ...], change: str, level: float, week: int
) -> tuple[Recording, str]:
    """Log of one week after a change of the virtual FR3, and the joint whose gain changed."""
    settings = now = settings_of(lib)
    payload, truth = None, 0
    if change == "friction":
        more, friction = 1 + 0.2 * level, settings.friction
        friction = replace(
            friction, coulomb=more * friction.coulomb, viscous=more * friction.viscous
        )
        now = replace(settings, friction=friction)
    if change == "payload":
        payload = Box(0.2 * level, (0.0, 0.0, 0.17), (0.05, 0.05, 0.05), "fr3_link7")
    if change == "model":
        now, truth = replace(settings, spread=settings.spread * 2 * level), 100 + week
    log = record(
        lib, designs[week % 2], now, seed=week + 1, truth_seed=truth, payload=payload
    ).recording
    tau, t, joint = np.array(log.tau), log.t, week // 2 % lib.n_joints
    if change == "sensor gain":
        tau[:, joint] *= 1 + 0.05 * level
    if change == "clock":
        tau = np.stack([np.interp(t - 0.005 * level, t, row) for row in tau.T], axis=1)
    return log.replace(tau=tau), lib.joint_names[joint]
