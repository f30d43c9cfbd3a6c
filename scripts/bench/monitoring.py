"""Monitoring of virtual FR3s: bands of drawn models, pushes, changes, and the time of observer.c.

Pushes: the model is identified from `TRAINING` motions of 10 s with the default friction model, and
thresholds are fitted to `CALIBRATION` further ones; every log is another motion with its own noise.
Weeks: the robot repeats two motions, from which its model was identified, one of them every week.
Finished logs and weeks are lines of a file, so that a run that was interrupted continues.
"""

import ctypes
import json
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from bench.coverage import COULOMB, NOISE, TERMS, VISCOUS
from bench.fleet import FILTERED, joined
from runtime import Recording, choose_default_friction
from runtime.estimators.convex.entropic_prior import CAD
from runtime.estimators.regression.samples import Samples
from runtime.excitation import Trajectory
from runtime.identification.posterior_file import SavedPosterior, read_posterior
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import SavedResult, read_result
from runtime.identification.single_log import identify_recording as fit
from runtime.library import Array, Library
from runtime.monitoring import noise
from runtime.monitoring.calibration import calibrated, calibrated_on
from runtime.monitoring.drift import Verdict, baseline_of, verdict_of
from runtime.monitoring.model import MonitoredModel, model_of
from runtime.monitoring.observation import (
    Detector,
    detector_for,
    observation_of,
    observe,
    prepared_for,
    signals_of,
)
from runtime.monitoring.posterior_draws import draw_models
from runtime.outputs.observer_c import observer_c
from runtime.recording import Friction
from runtime.recording.preprocessing import prepare
from runtime.simulation import Plant, ideal
from runtime.simulation.box_payload import Box, pi_from_pseudo
from runtime.simulation.settings import settings_of
from runtime.simulation.virtual_robot import record

OF_ARM = Friction(("viscous", "coulomb", "offset"))


@dataclass(frozen=True, slots=True)
class Known:
    """A result that was written and read again, as the commands of monitoring read it."""

    saved: SavedResult
    posterior: SavedPosterior
    model: MonitoredModel
    held_out: noise.HeldOutResidual
    test_rows: tuple[np.ndarray, Samples] | None


def known_of(lib: Library, log: Recording, terms: Friction | None = None, **how: Any) -> Known:
    """Identify a log, with the default friction model and all rows where no terms are given."""
    if terms is None:
        terms = choose_default_friction(log, lib, FILTERED).terms
        how = {"preparation": FILTERED, "refit": True}
    with TemporaryDirectory() as name:
        folder = Path(name)
        write_result(fit(log, lib, friction=terms, **how), folder, "scripts/monitoring_table")
        saved = read_result(folder)
        model = model_of(saved, lib)
        posterior = read_posterior(folder, saved, lib)
        held_out, rows = noise.read_held_out(folder, model), noise.read_test_rows(folder, model)
        return Known(saved, posterior, model, held_out, rows)


def resumed(
    done: Path, keys: list[tuple], work: Callable[[list[tuple]], Iterator[list[Any]]]
) -> list[list[Any]]:
    """Rows of keys: those of a file, and the others, which are added to it one by one."""
    done.parent.mkdir(exist_ok=True)
    lines = map(json.loads, done.read_text().splitlines() if done.exists() else [])
    known = {tuple(line[: len(keys[0])]): line[len(keys[0]) :] for line in lines}
    if wanted := [key for key in keys if key not in known]:
        for key, row in zip(wanted, work(wanted), strict=True):
            known[key] = row
            with done.open("a") as file:
                file.write(json.dumps([*key, *row]) + "\n")
    return [known[key] for key in keys]


def ranks_of_draws(
    lib: Library, designs: tuple[Trajectory, ...], robots: int, draws: int, gains: float
) -> dict[str, Array]:
    """Shares of the draws below the truth, per quantity, of robots of the prior about the URDF.

    Links are of its law, Wishart with 2 κ + 5 degrees of freedom about P0; torque gains are
    N(1, `gains`²), which the identification assumes too. Friction has a flat prior, so that its
    truth may be the same. Source: Talts et al. 2018.
    """
    inverse, ranks = np.linalg.inv(lib.pseudo_inertia(lib.pi0)), dict[str, list[float]]()
    root = np.linalg.cholesky(np.linalg.inv(inverse) / (2 * CAD))
    for robot in range(robots):
        rng = np.random.default_rng([8, robot])
        normal = root @ rng.normal(size=(len(root), 4, int(2 * CAD) + 5))
        pi = pi_from_pseudo(lib, normal @ np.swapaxes(normal, 1, 2))
        plant = Plant(pi, viscous=VISCOUS, coulomb=COULOMB, torque_noise=NOISE)
        log = ideal(lib, designs[robot % len(designs)], plant, rng=rng)
        log = log.replace(tau=log.tau * (1 + gains * rng.normal(size=lib.n_joints)))
        known = known_of(lib, log, TERMS, gain_sigma=gains)
        drawn = draw_models(lib, known.saved, known.posterior, draws, rng)
        phi = np.array([VISCOUS, COULOMB]), drawn.phi[:, :, :2].mean(axis=1)
        true = np.concatenate([_sizes(pi[None])[0], phi[0]])
        below = np.mean(np.column_stack([_sizes(drawn.pi), phi[1]]) < true, axis=0)
        for name, share in zip(_size_names(lib), below, strict=True):
            ranks.setdefault(name, []).append(float(share))
    return {name: np.array(each) for name, each in ranks.items()}


def _size_names(lib: Library) -> list[str]:
    """Quantities of `ranks_of_draws`: of 7 links 31."""
    each = [f"{what} of {name}" for name in lib.link_names for what in ("mass", *"xyz")]
    return [*each, "total mass", "viscous", "coulomb"]


def _sizes(pi: Array) -> Array:
    """Masses and centres of mass of every link, and the total mass, of models (N, 10 n)."""
    bodies = pi.reshape(len(pi), -1, 10)
    centres = bodies[..., 1:4] / bodies[..., :1]
    each = np.concatenate([bodies[..., :1], centres], axis=2).reshape(len(pi), -1)
    return np.column_stack([each, bodies[..., 0].sum(axis=1)])


def stated(per_hour: float) -> noise.AlarmRate:
    """Rate of false alarms per hour."""
    return noise.alarm_rate(f"{per_hour:g} per hour")


SAMPLES, REPEATS, RUNS = 4000, 50, 7
"""Samples of the log, how often it is passed over in a run, and number of runs."""
LOOP = """
#include <time.h>
#include "observer.h"
double run(const double (*log)[21], long samples, long repeats)
{
    static fr3_observer state;
    double r[7], threshold[7];
    const clock_t start = clock();
    for (long i = 0; i < samples * repeats; ++i) {
        const double *row = log[i % samples];
        fr3_observer_update(&state, row, row + 7, row + 14, r, threshold);
    }
    return (double)(clock() - start) / CLOCKS_PER_SEC / samples / repeats;
}
"""


def seconds_per_sample(lib: Library, design: Trajectory) -> float:
    """CPU time of one update, the median of `RUNS` runs [s]."""
    log = record(lib, design, seed=0).recording
    known = known_of(lib, log, OF_ARM, preparation=FILTERED)
    data = prepared_for(log.take(slice(0, SAMPLES), "part"), known.model)
    detector = detector_for(lib, known.model, data, known.held_out, stated(1.0))
    rows = np.hstack([data.q, data.dq, data.tau])
    with TemporaryDirectory() as name:
        folder = Path(name)
        texts = observer_c(lib, detector, np.zeros(lib.n_joints))
        for file, text in {**texts, "loop.c": LOOP}.items():
            (folder / file).write_text(text)
        sources = [folder / "loop.c", folder / "observer.c"]
        sources += [lib.folder / "kernels.c", lib.folder / "update.c"]
        command = ["cc", "-std=c99", "-O2", "-shared", "-fPIC", f"-I{lib.folder}", f"-I{folder}"]
        library = str(folder / "loop.so")
        subprocess.run([*command, *map(str, sources), "-lm", "-o", library], check=True)
        run = ctypes.CDLL(library)["run"]
    run.restype = ctypes.c_double
    words = (ctypes.c_void_p(rows.ctypes.data), ctypes.c_long(len(rows)), ctypes.c_long(REPEATS))
    return float(np.median([run(*words) for _ in range(RUNS)]))


TRAINING, FIRST_SEED = 6, 100_000
"""Number of training motions, and the seed of the first one that is drawn."""
CALIBRATION, CALIBRATION_SEED = 180, 200_000
"""The same of motions without contacts to which thresholds are fitted: half an hour."""
PUSH = (3.0, 3.0, 3.0, 3.0, 1.0, 1.0, 1.0)  # size of the pushes, N·m
WITHIN_S, PERIOD_S, LENGTH_S = 0.02, 0.5, 0.25
"""Time within which a push has to be found, time between two pushes, and their length, s."""
USED = 0.95  # share of the limits of speed and acceleration that a drawn motion may use
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
    keys = [(k,) for k in range(logs)]
    rows = resumed(done, keys, lambda wanted: _watched(lib, designs, wanted, pushed_logs))
    hits = [hit for row in rows for hit in row[2]]
    return Seen(
        sum(row[0] for row in rows) / 3600,
        {rate: sum(row[1][k] for row in rows) for k, rate in enumerate(STATED)},
        len(hits),
        tuple(j + 1 for j, is_found in hits if not is_found),
    )


def _watched(
    lib: Library, designs: tuple[Trajectory, ...], wanted: list[tuple], pushed_logs: int
) -> Iterator[list[Any]]:
    """Seconds of a log, alarms by rate, and joint and success of its pushes."""
    log = record(lib, designs[0], seed=FIRST_SEED).recording
    for k in range(1, TRAINING):
        motion = designs[1] if k == 1 else drawn_motion(lib, designs, FIRST_SEED + k)
        log = joined(log, record(lib, motion, seed=FIRST_SEED + k).recording, 0.5)
    known = known_of(lib, log)
    model, root = known.model, known.posterior.of_readings().root(lib)

    def free(k: int) -> Recording:
        return prepared_for(record(lib, drawn_motion(lib, designs, k), seed=k + 1).recording, model)

    first = free(CALIBRATION_SEED)
    plain = [
        detector_for(lib, model, first, known.held_out, stated(rate), WITHIN_S, root)
        for rate in STATED
    ]
    # One observer for all rates: a rate changes the levels alone.
    one = plain[STATED.index(AT)]
    one, tails = calibrated_on(lib, one, [free(CALIBRATION_SEED + k) for k in range(CALIBRATION)])
    detectors = [calibrated(replace(one, rate=each.rate), tails) for each in plain]
    for (k,) in wanted:
        data = free(k)
        signals = signals_of(lib, one, data)
        seen = [observation_of(lib, each, signals) for each in detectors]
        at = detectors[STATED.index(AT)]
        starts, hits = np.arange(data.t[0] + PERIOD_S, data.t[-1] - PERIOD_S, PERIOD_S), []
        if k < pushed_logs:
            joints = [(k + i) % lib.n_joints for i in range(len(starts))]
            found = pushed(lib, at, data, starts, joints, np.array(PUSH), LENGTH_S, (0, WITHIN_S))
            hits = [*zip(joints, found, strict=True)]
        yield [seen[0].seconds, [len(each.contacts) for each in seen], hits]


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


def pushed(
    lib: Library,
    detector: Detector,
    data: Recording,
    starts: Array,
    joints: list[int],
    sizes: Array,
    length_s: float,
    within_s: tuple[float, float],
) -> list[bool]:
    """Whether pushes of stated sizes per joint that are added to a log are found in time."""
    tau = np.array(data.tau)
    for start, j in zip(starts, joints, strict=True):
        tau[(data.t >= start) & (data.t < start + length_s), j] -= sizes[j]
    contacts = observe(lib, detector, data.replace(tau=tau)).contacts
    low, high = within_s
    return [
        any(c.number == j and low <= c.time_s - start <= high for c in contacts)
        for start, j in zip(starts, joints, strict=True)
    ]


CHANGES = ("sensor gain", "payload", "friction", "clock", "model")
WEEKS_SEED, PAUSE_S = 1000, 0.5
"""Seed of the training log, and the pause between its two motions, s."""
REFERENCES = range(10_000, 10_004)
"""Weeks whose logs are those of reference."""


def weeks(
    lib: Library, designs: tuple[Trajectory, ...], counts: dict[float, int], done: Path
) -> dict[tuple[float, str], tuple[int, int, int]]:
    """Verdicts on weekly logs of the virtual FR3 with and without a change."""
    keys = [*_wanted(counts)]
    rows = resumed(done, keys, lambda wanted: _weeks(lib, designs, wanted))
    seen = {key[:2]: [0, 0, 0] for key in keys}
    for key, (is_changed, is_right, *_) in zip(keys, rows, strict=True):
        for k, count in enumerate((1, is_changed, is_right)):
            seen[key[:2]][k] += count
    return {key: tuple(each) for key, each in seen.items()}


def _weeks(
    lib: Library, designs: tuple[Trajectory, ...], wanted: list[tuple]
) -> Iterator[list[Any]]:
    """Whether a week is seen as changed and named rightly, and its best cause."""
    one, two = (record(lib, each, seed=WEEKS_SEED + k).recording for k, each in enumerate(designs))
    model = known_of(lib, joined(one, two, PAUSE_S))
    root, sigma = model.posterior.of_readings().root(lib), model.held_out.rest.std(axis=0)

    def prepared(change: str, level: float, week: int) -> tuple[Recording, str]:
        log, joint = changed_log(lib, designs, change, level, week)
        return prepare(log, FILTERED, model.saved.friction, lib=lib), joint

    healthy = [prepared("", 1.0, week)[0] for week in REFERENCES]
    baseline = baseline_of(lib, model.saved, root, sigma, model.test_rows, healthy)
    for level, change, week in wanted:
        log, joint = prepared(change, level, week)
        verdict = verdict_of(lib, baseline, log)
        best = [verdict.best.group, verdict.best.where, verdict.p_value]
        yield [verdict.changed, _is_right(verdict, change, joint), *best]


def _wanted(counts: dict[float, int]) -> Iterator[tuple[float, str, int]]:
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
