"""Logs of the virtual FR3, empty and with the payload, in place of the document's real ones.

Every log is a trial: MuJoCo's physics, an arm that differs from its CAD model, friction with
memory, sensors with bias. The repeats are the training motion again, with other noise.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.excitation import Trajectory
from runtime.excitation.search.finish import repaired
from runtime.excitation.search.single_start import Search, SearchProblem
from runtime.experiments.study import Arrays, Row, Study, StudyOutcome
from runtime.experiments.trials.document_robot import document_robot
from runtime.experiments.trials.motions import ROLES, curves, designed
from runtime.experiments.trials.scores import per_joint, torque_rms
from runtime.experiments.views import motion as motion_view
from runtime.library import Array, Library
from runtime.recording import Recording
from runtime.recording.preprocessing import DOCUMENT
from runtime.recording.preprocessing import prepare as prepared
from runtime.simulation import Box, read_payload, record, sample_times, settings_of

EMPTY, LOADED = "empty", "payload"
KEYS = ("q", "dq", "tau")
PREPARATION = replace(DOCUMENT, trim_s=0.15)
"""The document's, without the ends, where centred windows narrow and ddq is not averaged like τ."""


@dataclass(frozen=True, slots=True)
class LogsConfig:
    """Which arm, which noise, what is carried.

    Attributes:
        truth_seed: of the arm, one whose errors before tuning and with the payload are within a
            quarter of the document's at joints 1 to 6.
        test_seed: of the test motion, a design of its own (one start): on it the joints work as
            hard as in the document, whose motions are not told; training and validation are the
            best two of the excitation study.
        payload: a box, kg and m in the frame of link 7.
        repeats: further logs of the training motion.
    """

    seed: int = 0
    truth_seed: int = 4
    test_seed: int = 31
    payload: str = "1.8,0.01,0.02,0.167,0.1,0.08,0.1"
    repeats: int = 2


@dataclass(frozen=True, slots=True)
class LogsSetup:
    """The arm and its motions."""

    lib: Library
    config: LogsConfig
    pi: Array
    motions: dict[str, Trajectory]
    box: Box


def roles(config: LogsConfig) -> tuple[str, ...]:
    """Training, validation, test, and training again."""
    return (*ROLES, *(f"repeat {k}" for k in range(1, config.repeats + 1)))


def prepare(lib: Library, config: LogsConfig, needed: Arrays) -> LogsSetup:
    """The designed motions."""
    designs = designed(lib, needed)
    designs[2] = _design(lib, designs[0], config.test_seed)
    motions = {role: designs[k if k < len(ROLES) else 0] for k, role in enumerate(roles(config))}
    return LogsSetup(lib, config, document_robot(lib), motions, read_payload(config.payload))


def _design(lib: Library, like: Trajectory, seed: int) -> Trajectory:
    """One start in document mode."""
    harmonics = like.coefficients.shape[1]
    search = Search(
        lib, SearchProblem(lib.folder, lib.level, lib.home, harmonics, like.duration, seed)
    )
    return repaired(lib, search, search.refined(search.start(0)[1])).trajectory


def run(setup: LogsSetup, numbers: range, threads: int) -> list[Row]:
    """One log per trial: first all empty ones, then all with the payload."""
    del threads
    names = roles(setup.config)
    rows: list[Row] = []
    for number in numbers:
        case, role = (EMPTY, LOADED)[number // len(names)], names[number % len(names)]
        log = record(
            setup.lib,
            setup.motions[role],
            seed=1000 * setup.config.seed + number,
            truth_seed=setup.config.truth_seed,
            payload=setup.box if case == LOADED else None,
            pi=setup.pi,
        )
        measured = [np.asarray(getattr(log.recording, key)) for key in KEYS]
        row: Row = {"case": case, "method": role, "trial": number}
        row |= per_joint("measured_rms", torque_rms(measured[-1]))
        row |= {"saturated": float(log.truth.saturated.max())}
        rows.append(
            row | {"curve": np.concatenate([log.truth.pi, *map(np.ravel, measured)]).tolist()}
        )
    return rows


def finish(setup: LogsSetup, rows: list[Row]) -> StudyOutcome:
    """`CASE/ROLE/q`, `…/dq`, `…/tau` as measured, `CASE/pi`, and the training of Figs. A.3, A.4."""
    lib, config = setup.lib, setup.config
    settings = settings_of(lib)
    motion = setup.motions["training"]
    series: dict[str, Array] = {"t": sample_times(motion.duration, settings.rate_hz)}
    for row in rows:
        values = np.array(row["curve"])
        pi, parts = np.split(values, [setup.pi.size])[0], values[setup.pi.size :]
        shape = (len(KEYS), len(series["t"]), lib.n_joints)
        name = f"{row['case']}/{row['method']}"
        series[f"{row['case']}/pi"] = pi
        series |= {f"{name}/{k}": a for k, a in zip(KEYS, parts.reshape(shape), strict=True)}
    history: tuple[str, ...] = ()
    for case, prefix in ((EMPTY, "tuning"), (LOADED, "loaded")):
        done = prepared(log_of(lib, series, case, "training"), PREPARATION)
        series |= curves(prefix, done)
        history = done.history
    facts = {
        "robot": "virtual FR3 in MuJoCo; friction and payload were calibrated once to Tables 5.9 "
        "and 5.10, so the error levels agree by construction, iterations and rankings do not",
        "settings": settings.facts(),
        "raw_rate_hz": settings.rate_hz,
        "raw_samples": len(series["t"]),
        "preparation": list(history),
        "seed": config.seed,
        "truth_seed": config.truth_seed,
        "test_motion": f"a design of its own, seed {config.test_seed}, chosen so that the joints "
        "work as hard as in the document",
        "payload": setup.box.facts(lib),
    }
    return StudyOutcome(series, facts)


def log_of(lib: Library, series: Arrays, case: str, role: str) -> Recording:
    """A log as it was measured."""
    q, dq, tau = (series[f"{case}/{role}/{key}"] for key in KEYS)
    return Recording(
        series["t"], q, dq, None, tau, name=f"{case} {role}", joint_names=lib.joint_names
    )


def robot_facts(lib: Library) -> dict[str, Any]:
    """The virtual robot's settings are part of the config."""
    return {"settings_sha256": settings_of(lib).sha256}


STUDY = Study(
    name="logs",
    title="Logs of the virtual FR3",
    config=LogsConfig(),
    prepare=prepare,
    run=run,
    finish=finish,
    cases={EMPTY: "without payload", LOADED: "with a box of 1.8 kg"},
    methods={role: f"the {role} motion" for role in roles(LogsConfig())},
    trials=2 * len(roles(LogsConfig())),
    needs=("excitation",),
    robot_facts=robot_facts,
    per_chunk=1,
    views=(
        motion_view("fig-A.3", "Measured training trajectory, parameter tuning", "tuning"),
        motion_view("fig-A.4", "Measured training trajectory, payload adaptation", "loaded"),
    ),
)
