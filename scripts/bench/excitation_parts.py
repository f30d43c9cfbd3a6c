"""Errors of `scripts/bench_excitation --parts`: causes of the real error on virtual arms.

The same logs of virtual arms are identified again without one cause each, or with one alone: gains
of the torque sensors, friction beyond the columns, noise of the torque, measured motion. The true
states of the simulation replace the measured ones, and the friction that the columns describe best
replaces that of the joints.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from bench.compiled import processor
from bench.excitation_designs import NOISE, PREPARATION, RATE, TERMS, error_of, promised_of
from bench.front import Sheet
from runtime.excitation import Safety, Trajectory, design, information
from runtime.excitation.search.unseen_motions import unseen_joints
from runtime.library import Array, Library
from runtime.recording import Recording
from runtime.recording.friction import JointMotion, columns
from runtime.simulation import record

DURATION, HARMONICS = 20.0, 8
"""Of the design, s, and functions per joint."""


@dataclass(frozen=True, slots=True)
class Row:
    """RMS errors over the arms, of the torque of other motions, all joints, N·m."""

    label: str  # what the logs contain
    real: float  # error of the identified model
    from_residuals: float  # of `predict` with the residuals of the logs


@dataclass(frozen=True, slots=True)
class Report:
    """Measurements of one run."""

    robot: str
    processor: str
    starts: int
    arms: int
    rows: tuple[Row, ...]


def measure(lib: Library, starts: int, arms: int, seed: int, say: Callable[[str], None]) -> Report:
    """Design, record and identify with and without each cause."""
    motion = design(
        lib,
        duration=DURATION,
        harmonics=HARMONICS,
        starts=starts,
        seed=seed,
        criterion="mixed",
        information=information(lib, NOISE, RATE),
        safety=Safety(table=0.0),
    ).trajectory
    joints = unseen_joints(lib, lib.home)
    errors: dict[str, list[tuple[float, float]]] = {}
    for arm in range(arms):
        for label, (log, pi) in _logs(lib, motion, arm).items():
            real = error_of(lib, log, PREPARATION, pi, joints)
            errors.setdefault(label, []).append((real, promised_of(lib, log, joints)[0]))
        say(f"arm {arm}: {1e3 * errors['all'][-1][0]:.0f} mN·m")
    means = {label: np.sqrt(np.mean(np.square(pairs), axis=0)) for label, pairs in errors.items()}
    rows = tuple(Row(label, float(real), float(low)) for label, (real, low) in means.items())
    return Report(lib.name, processor(), starts, arms, rows)


def _logs(lib: Library, motion: Trajectory, arm: int) -> dict[str, tuple[Recording, Array]]:
    """Logs of one arm by what they contain, and the parameters of its links."""
    whole = record(lib, motion, seed=arm, truth_seed=arm)
    log, true, sensors = whole.recording, whole.motion, whole.truth.sensors
    rigid = lib.regressor(true.q, true.dq, true.ddq) @ whole.truth.pi
    friction = true.link - rigid
    described = np.empty_like(friction)
    shapes = columns(JointMotion(true.dq), TERMS)
    for j in range(lib.n_joints):
        described[:, j] = shapes[:, j] @ np.linalg.lstsq(shapes[:, j], friction[:, j])[0]
    usual = rigid + described
    noise = log.tau - (sensors.gain * true.link + sensors.bias)
    measured, exact = (log.q, log.dq), (true.q, true.dq)
    torques = {
        "all": (measured, log.tau),
        "all but wrong gains": (measured, true.link + sensors.bias + noise),
        "all but friction beyond the columns": (
            measured,
            sensors.gain * usual + sensors.bias + noise,
        ),
        "all but noise of the torque": (measured, sensors.gain * true.link + sensors.bias),
        "all with the exact motion": (exact, log.tau),
        "wrong gains alone": (exact, sensors.gain * usual + sensors.bias),
        "friction beyond the columns alone": (exact, true.link),
        "measured motion alone": (measured, usual),
    }
    names = lib.joint_names
    return {
        label: (
            Recording(log.t, q, dq, None, tau, name="virtual", joint_names=names),
            whole.truth.pi,
        )
        for label, ((q, dq), tau) in torques.items()
    }


_HEAD = "the logs contain", "real", "by residuals"


def sheet(report: Report) -> Sheet:
    """One line per set of causes."""
    title = f"{report.robot}: causes of the real error, {report.processor}"
    caption = (
        f"Criterion mixed, {DURATION:g} s, best of {report.starts} starts. RMS torque error on "
        f"unseen motions, mN·m, over {report.arms} virtual arms."
    )
    return Sheet("bench_excitation_parts", _HEAD, [*_lines(report)], report, title, caption)


def _lines(report: Report) -> Iterator[tuple[str, ...]]:
    for row in report.rows:
        yield row.label, f"{1e3 * row.real:.0f}", f"{1e3 * row.from_residuals:.0f}"
