"""Settings of the studies, the clock of their fits, and what a worker keeps between chunks."""

import json
from dataclasses import asdict
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from runtime import parallel
from runtime.experiments import STUDIES, trials
from runtime.experiments import runner as cluster
from runtime.experiments.trials import sinusoidal
from runtime.library import Library
from tests.robots import DATA


def test_the_settings_of_the_studies_are_those_of_the_last_release() -> None:
    """Oracle: `tests/data/studies.json`; another setting drops the rows that users have computed.

    Where a study changes on purpose, its entry there changes with it.
    """
    known = json.loads((DATA / "studies.json").read_text())
    for name, study in STUDIES.items():
        settings = {"trials": study.trials, "per_chunk": study.per_chunk}
        assert known.pop(name) == json.loads(json.dumps(settings | asdict(study.config))), name
    assert not known


def test_sines_have_the_phases_of_their_seed(lib: Library) -> None:
    """Oracle: q = a + b sin(2t + φ) of Eq. 5.5 at one instant, φ of NumPy's generator."""
    log, amplitude = sinusoidal(lib, 4.0, 100.0, 0.5, 7)
    phase = np.random.default_rng(7).uniform(0, 2 * np.pi, lib.n_joints)
    angle = 2.0 * log.t[123] + phase
    # Rounding of angles of 10 rad.
    np.testing.assert_allclose(log.q[123], lib.home + amplitude * np.sin(angle), atol=1e-14)
    np.testing.assert_allclose(log.dq[123], 2.0 * amplitude * np.cos(angle), atol=1e-13)


def test_the_time_of_one_call_is_shared_by_iterations(monkeypatch) -> None:
    """Oracle: 12 s for 100 and 500 iterations are 2 s and 10 s."""
    fits = [SimpleNamespace(iterations=k, outcome=None, status="") for k in (100, 500)]
    clock = iter((5.0, 17.0))
    monkeypatch.setattr(trials, "fit_many", lambda *_args, **_words: fits)
    monkeypatch.setattr(trials, "_require_uninterrupted", lambda _: None)
    monkeypatch.setattr(trials, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    shared = trials.adam_of_all([], SimpleNamespace(), 1)
    assert [seconds for _, seconds in shared] == pytest.approx([2.0, 10.0])


def test_a_worker_prepares_a_study_once(monkeypatch) -> None:
    """Property: chunks of one key share what was prepared; those of another key do not."""
    prepared = []

    def prepare(_lib: object, config: str, _needed: object) -> str:
        prepared.append(config)
        return f"input of {config}"

    study = SimpleNamespace(prepare=prepare, run=lambda known, numbers, _: [known, *numbers])
    monkeypatch.setitem(STUDIES, "study", study)
    monkeypatch.setattr(cluster, "load", lambda *_: None)
    monkeypatch.setattr(parallel, "_here", SimpleNamespace())
    chunks = [("a", range(2)), ("a", range(2, 3)), ("b", range(2)), ("b", range(2, 4))]
    rows = []
    for key, numbers in chunks:
        prepare = partial(cluster._prepared, "study", (Path(), ""), key, {})
        rows.append(parallel._on_worker(key, prepare, cluster._rows, numbers))
    assert prepared == ["a", "b"]
    assert [r for _, r in rows] == [
        ["input of a", 0, 1],
        ["input of a", 2],
        ["input of b", 0, 1],
        ["input of b", 2, 3],
    ]
