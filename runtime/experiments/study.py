"""What an experiment is: a frozen config, trials that depend on (config, number) alone, views.

A `Study` is data and three functions, which a worker elsewhere finds by the study's name:
`prepare` makes what all trials share, `run` does some trials, `finish` turns all rows into curves
and facts.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

import numpy as np

from runtime.library import Array, Library

FORMAT = 1
"""Of everything that is written; another one is another hash."""

Row = dict[str, Any]
"""One line of trials.parquet: case, method, trial, then figures by name; `curve` is a list."""
Arrays = Mapping[str, Array]


class StudyConfig(Protocol):
    """A frozen dataclass of plain values, tuples and dataclasses."""

    @property
    def seed(self) -> int:
        """Of everything random in the trials."""


@dataclass(frozen=True, slots=True)
class FixedConfig:
    """The config of a study in which nothing is random and nothing to be chosen."""

    seed: int = 0


def library_alone(lib: Library, config: StudyConfig, needed: Arrays) -> Library:
    """What trials share that need nothing but the library."""
    del config, needed
    return lib


@dataclass(frozen=True, slots=True)
class View:
    """One id: a table or a figure of the document, and where its numbers stand.

    Attributes:
        id: as on the command line.
        kind: table, band (mean ± std), lines, path (3-d), motion (q dq ddq tau), loglog or bars.
        title: for people.
        cases: of the rows, in the order of the columns; empty is all.
        metrics: names of columns of trials.parquet, in the order of the lines.
        series: names in series.npz, of a figure.
        axes: labels of x and y, of a figure.
        document: the id under which document.toml holds its numbers, where that is another one.
    """

    id: str
    kind: str
    title: str
    cases: tuple[str, ...] = ()
    metrics: tuple[str, ...] = ()
    series: tuple[str, ...] = ()
    axes: tuple[str, str] = ("", "")
    document: str = ""


@dataclass(frozen=True, slots=True)
class StudyOutcome:
    """What all rows together give.

    Attributes:
        series: arrays by name.
        facts: what must be reported of the data: rates, counts, filters, conditions.
        rows: further lines of trials.parquet that only all trials together give.
    """

    series: dict[str, Array] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)
    rows: list[Row] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Study:
    """One experiment, from which several ids may be read.

    Attributes:
        name: of its folder.
        run: (prepared, numbers, threads) → rows; a row depends on its number alone.
        finish: (prepared, all rows) → curves and facts.
        views: its ids.
        config: default; its seed may be replaced.
        prepare: (library, config, arrays of `needs`) → what `run` and `finish` are given.
        cases, methods: name → a sentence.
        robot_facts: what else of the library's robot belongs to the config.
        trials: number of them where that is fixed, None where it is asked for.
        takes_seed: False where another seed would be another experiment for the others.
        needs: studies whose series come first.
        per_chunk: trials between two files.
    """

    name: str
    title: str
    run: Callable[[Any, range, int], list[Row]]
    finish: Callable[[Any, list[Row]], StudyOutcome]
    views: tuple[View, ...]
    config: StudyConfig = FixedConfig()
    prepare: Callable[[Library, Any, Arrays], Any] = library_alone
    cases: Mapping[str, str] = field(default_factory=dict)
    methods: Mapping[str, str] = field(default_factory=dict)
    robot_facts: Callable[[Library], Mapping[str, Any]] | None = None
    trials: int | None = None
    takes_seed: bool = True
    needs: tuple[str, ...] = ()
    per_chunk: int = 25


def canonical(value: object) -> str:
    """JSON with sorted keys, without blanks: one text per value."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False)


def config_facts(study: Study, config: StudyConfig, lib: Library) -> dict[str, Any]:
    """A config as plain data, with its study and the format."""
    plain = json.loads(canonical(asdict(config)))  # type: ignore[call-overload]
    more = study.robot_facts(lib) if study.robot_facts else {}
    return {"format": FORMAT, "study": study.name, **plain, **more}


def config_hash(facts: Mapping[str, Any], model_hash: str, needed: Arrays) -> str:
    """sha256 of config, robot and what was taken from other studies: same hash, same digits."""
    digest = hashlib.sha256(canonical([facts, model_hash]).encode())
    for name in sorted(needed):
        digest.update(name.encode() + np.ascontiguousarray(needed[name], dtype=float).tobytes())
    return digest.hexdigest()
