"""Definition of a study: a frozen config, trials that depend on (config, number) only, views.

A `Study` has three functions, which a remote worker imports by the name of the study: `prepare`
computes what all trials share, `run` computes some trials, `finish` turns all rows into series and
facts.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

import numpy as np

from runtime.library import Array, Library

FORMAT = 1  # format number of all files; it is part of the config hash

Row = dict[str, Any]  # of trials.parquet: case, method, trial, metrics; `curve` is a list
Arrays = Mapping[str, Array]


class StudyConfig(Protocol):
    """A frozen dataclass of plain values, tuples and dataclasses."""

    @property
    def seed(self) -> int:
        """Seed of all random numbers of the trials."""


@dataclass(frozen=True, slots=True)
class FixedConfig:
    """Config of a study without random numbers and parameters."""

    seed: int = 0


def library_alone(lib: Library, config: StudyConfig, needed: Arrays) -> Library:
    """Prepared input of a study that needs only the library."""
    return lib


@dataclass(frozen=True, slots=True)
class View:
    """One table or figure of the document, and the names of its numbers."""

    id: str  # name on the command line
    kind: str  # table, band (mean ± std), lines, path (3-d), motion (q dq ddq tau), loglog or bars
    title: str  # displayed title
    cases: tuple[str, ...] = ()  # of the rows, in the order of the columns; empty for all
    metrics: tuple[str, ...] = ()  # columns of trials.parquet, in the order of the rows
    series: tuple[str, ...] = ()  # names in series.npz, for a figure
    axes: tuple[str, str] = ("", "")  # labels of x and y, for a figure
    document: str = ""  # id of its numbers in document_numbers.toml, where it differs from `id`
    spread: str = "std"  # of several rows in a table: std (mean ± deviation) or quartiles


@dataclass(frozen=True, slots=True)
class StudyOutcome:
    """Results of all rows of a study."""

    series: dict[str, Array] = field(default_factory=dict)  # arrays by name
    facts: dict[str, Any] = field(default_factory=dict)  # rates, counts, filters, conditions
    rows: list[Row] = field(default_factory=list)  # of trials.parquet, computed from all trials


@dataclass(frozen=True, slots=True)
class Study:
    """One experiment, which may have several views."""

    name: str  # name of its folder
    title: str  # displayed title
    run: Callable[[Any, range, int], list[Row]]  # (prepared, numbers, threads) → independent rows
    finish: Callable[[Any, list[Row]], StudyOutcome]  # (prepared, all rows) → series and facts
    views: tuple[View, ...]  # its tables and figures
    config: StudyConfig = FixedConfig()  # default; its seed may be replaced
    prepare: Callable[[Library, Any, Arrays], Any] = library_alone  # → input of `run`, `finish`
    cases: Mapping[str, str] = field(default_factory=dict)  # cases, methods: name → a sentence
    methods: Mapping[str, str] = field(default_factory=dict)
    robot_facts: Callable[[Library], Mapping[str, Any]] | None = None  # of the robot
    trials: int | None = None  # fixed number of trials; None where the request determines it
    takes_seed: bool = True  # False where another seed would change the input of other studies
    needs: tuple[str, ...] = ()  # studies whose series are needed
    per_chunk: int = 25  # number of trials per file


def canonical(value: object) -> str:
    """JSON with sorted keys and without blanks: equal values give equal text."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False)


def config_facts(study: Study, config: StudyConfig, lib: Library) -> dict[str, Any]:
    """Config as plain data, with the study and the format number."""
    plain = json.loads(canonical(asdict(config)))  # type: ignore[call-overload]
    more = study.robot_facts(lib) if study.robot_facts else {}
    return {"format": FORMAT, "study": study.name, **plain, **more}


def config_hash(facts: Mapping[str, Any], model_hash: str, needed: Arrays) -> str:
    """SHA-256 of config, robot and arrays of other studies; equal hashes give equal digits."""
    digest = hashlib.sha256(canonical([facts, model_hash]).encode())
    for name in sorted(needed):
        digest.update(name.encode() + np.ascontiguousarray(needed[name], dtype=float).tobytes())
    return digest.hexdigest()


TORQUE = tuple(f"tau_error_{joint}" for joint in range(1, 8))  # torque errors in the document

MOTION = ("t", "q", "dq", "ddq", "tau")  # series of a motion, without the prefix of the motion


def torque_table(name: str, title: str, cases: tuple[str, ...], *more: str) -> View:
    """Table of the torque errors of all joints, and of further metrics."""
    return View(name, "table", f"{title}: torque errors, %", cases, (*TORQUE, *more))


def torque_bars(name: str, title: str, cases: tuple[str, ...]) -> View:
    """Bars of the torque errors of all joints, grouped by method."""
    return View(name, "bars", title, cases, TORQUE, axes=("joint", "torque error [%]"))


def motion(name: str, title: str, prefix: str) -> View:
    """Figure of a motion, from the series of `motions.curves`."""
    series = tuple(f"{prefix}_{key}" for key in MOTION)
    return View(name, "motion", title, series=series, axes=("time [s]", ""))
