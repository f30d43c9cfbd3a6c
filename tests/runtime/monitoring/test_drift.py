"""Drift watch: what was changed is named with its size, and nothing where nothing was."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec import structs
from scipy.signal import lfilter
from scipy.stats import chi2

from runtime import Recording, write_recording
from runtime.estimators.regression.samples import samples_of
from runtime.excitation import Trajectory
from runtime.identification.identified import Identification, torque_of
from runtime.identification.posterior_file import read_posterior
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import read_result
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.monitoring import drift
from runtime.monitoring.drift import (
    Change,
    Hypothesis,
    Verdict,
    _ranked,
    _tested,
    baseline_of,
    hypotheses,
    verdict_of,
)
from runtime.monitoring.model import model_of
from runtime.monitoring.noise import read_held_out, read_test_rows
from runtime.monitoring.scores import Scores, changes_of
from runtime.recording import Friction, Preparation
from runtime.recording.preprocessing import prepare
from runtime.simulation import Plant, ideal
from tests.runtime.conftest import Command
from tests.runtime.monitoring.later_logs import FRICTION, NOISE, later_log

CASES = {
    "sensor gain": ("fr3_joint3", 5.0, 0.7),
    "sensor bias": ("fr3_joint5", 0.1, 0.02),
    "sensor bias of all": ("", None, 0.0),
    "sensor drift": ("fr3_joint5", 0.2, 0.06),
    "warming": ("", -30.0, 12.0),
    "friction": ("", 20.0, 6.0),
    "payload": ("fr3_link7", 0.2, 0.02),
    "clock": ("", 5.0, 0.8),
    "links": ("fr3_link4", 0.3, 0.1),
    "model": ("", None, 0.0),
}
"""Group → place, size that is injected, and four standard deviations of its estimate."""


@pytest.fixture
def changed(
    command: Command,
    arm: Path,
    lib: Library,
    trajectories: tuple[Trajectory, ...],
    pi_true: np.ndarray,
    tmp_path: Path,
) -> Callable[[str], dict]:
    """What `watch` states of a later log with a change; its exit code is that of a change."""

    def watched(change: str) -> dict:
        log = later_log(lib, trajectories[1], pi_true, change)
        write_recording(log, tmp_path / "later.csv")
        ran = command("watch", arm, "later.csv", "--json")
        assert ran.code == 1, ran.err
        return json.loads(ran.out)

    return watched


@pytest.mark.parametrize("group", CASES)
def test_a_change_is_named(group: str, changed: Callable[[str], dict]) -> None:
    """Oracle: group, place and size of a change that we make; exit code 1."""
    facts = changed(group)
    where, size, tolerance = CASES[group]
    group = group.removesuffix(" of all")
    assert (facts["changed"], facts["group"], facts["where"]) == (True, group, where)
    assert facts["p_value"] < 0.01
    if size is not None:
        assert facts["size"] == pytest.approx(size, abs=tolerance)
        assert facts["interval"][0] < facts["size"] < facts["interval"][1]


def test_a_link_that_leaves_another_change_is_not_all(changed: Callable[[str], dict]) -> None:
    """Oracle: a body on a link together with another sensor is a wrong model, not that link."""
    facts = changed("link and sensor")
    assert (facts["group"], facts["where"]) == ("model", "")


@pytest.mark.parametrize(("lead", "named"), [(11.0, "model"), (26.0, "model"), (71.0, "links")])
def test_one_link_of_many_is_not_named_alone(lead: float, named: str) -> None:
    """Property: the score of a link must exceed that of all base parameters clearly.

    The leads are those of two virtual robots whose links all differ, and of a body on one link.
    """
    whole = Change("model", "", 400.0, 43, 0.0, 100.0, None, None, "")
    link = Change("links", "fr3_link3", 300.0, 10, 0.0, 100.0 + lead, 0.3, (0.2, 0.4), "kg")
    gain = Change("sensor gain", "fr3_joint1", 20.0, 1, 0.0, 30.0, 5.0, (4.0, 6.0), "%")
    ranked = _ranked([gain, whole, link], 72.0)
    assert ranked[0].group == named
    assert [each.group for each in ranked[1:]] == [
        "links" if named == "model" else "model",
        "sensor gain",
    ]
    tool = dataclasses.replace(link, group="payload")
    assert _ranked([gain, whole, tool], 72.0)[0].group == "payload"


def test_a_link_of_the_same_mass_is_said_to_be_one() -> None:
    """Property: a mass that may be unchanged is no size of the change."""
    heavier = Change("links", "fr3_link3", 90.0, 10, 0.0, 50.0, 0.3, (0.2, 0.4), "kg")
    same = dataclasses.replace(heavier, size=-0.003, interval=(-0.41, 0.4))
    first, second = (
        Verdict("log", True, best, 1e-7, 100.0, 2.0, (best,)).sentence() for best in (heavier, same)
    )
    assert "fr3_link3 changed by +0.3 kg (95 %: +0.2 to +0.4)" in first
    assert "changed in its centre of mass or inertia, its mass by -0.003 kg (95 %: -0.41" in second


def test_nothing_is_named_where_nothing_changed(
    command: Command,
    arm: Path,
    lib: Library,
    trajectories: tuple[Trajectory, ...],
    pi_true: np.ndarray,
    tmp_path: Path,
) -> None:
    """Property: six logs without a change, exit code 0; the history is only appended to."""
    names = []
    for k in range(6):
        log = later_log(lib, trajectories[1 + k % 2], pi_true, "", seed=10 + k)
        write_recording(log, tmp_path / f"{k}.csv")
        names.append(f"{k}.csv")
    ran = command("watch", arm, *names, "--json", "--history", "h.jsonl")
    assert ran.code == 0, ran.out
    facts = json.loads(ran.out)
    assert facts["changed"] is False
    assert facts["group"] is None
    assert len(facts["logs"]) == 6
    before = (tmp_path / "h.jsonl").read_text()
    entries = [json.loads(line) for line in before.splitlines()]
    assert len(entries) == 6
    assert entries[0]["model_hash"] == lib.manifest.model_hash
    assert len(entries[0]["log_sha256"]["0.csv"]) == 64
    assert command("watch", arm, names[0], "--history", "h.jsonl").code == 0
    after = (tmp_path / "h.jsonl").read_text()
    assert after.startswith(before)
    assert len(after.splitlines()) == 7


def test_the_history_has_date_temperature_and_sizes(
    command: Command,
    arm: Path,
    lib: Library,
    trajectories: tuple[Trajectory, ...],
    pi_true: np.ndarray,
    tmp_path: Path,
) -> None:
    """Oracle: mean of the column that we wrote, the stated date, the gain that we changed."""
    write_recording(later_log(lib, trajectories[1], pi_true, "sensor gain"), tmp_path / "a.csv")
    head, *rows = (tmp_path / "a.csv").read_text().splitlines()
    warm = [f"{row},{20 + k % 11}" for k, row in enumerate(rows)]
    (tmp_path / "a.csv").write_text("\n".join([f"{head},motor_temp", *warm]) + "\n")
    words = ("watch", arm, "a.csv", "--history", "h.jsonl")
    ran = command(*words, "--settings", "temperature=motor_temp", "--settings", "date=2026-11-30")
    assert ran.code == 1, ran.err
    entry = json.loads((tmp_path / "h.jsonl").read_text())
    expected = np.mean([20 + k % 11 for k in range(len(rows))])
    assert entry["temperature"] == pytest.approx(expected, rel=1e-12)
    assert entry["recorded"].startswith("2026-11-30")
    sizes = {(each["group"], each["where"]): each for each in entry["sizes"]}
    assert sizes["sensor gain", "fr3_joint3"]["size"] == pytest.approx(entry["size"])
    assert len(sizes) > 25
    for option, value in (
        ("--settings", "temperature=nothing"),
        ("--settings", "temperature=1e9"),
        ("--settings", "date=x"),
    ):
        ran = command(*words, option, value)
        assert ran.code == 2
        assert value.partition("=")[2] in ran.err
    assert len((tmp_path / "h.jsonl").read_text().splitlines()) == 1


def test_a_file_that_is_no_history_stays(
    command: Command, arm: Path, log: Path, tmp_path: Path
) -> None:
    """Property: exit code 2, one sentence, the file unchanged."""
    (tmp_path / "mine.txt").write_text("mine\n")
    ran = command("watch", arm, log, "--history", "mine.txt")
    assert ran.code == 2
    assert "--history" in ran.err
    assert (tmp_path / "mine.txt").read_text() == "mine\n"


def test_the_usual_change_between_days_is_learnt(
    command: Command,
    arm: Path,
    lib: Library,
    trajectories: tuple[Trajectory, ...],
    pi_true: np.ndarray,
    tmp_path: Path,
) -> None:
    """Oracle: sensor offsets that differ from day to day are no change, a gain is; names differ."""
    rng = np.random.default_rng(5)
    names = []
    for k in range(4):
        log = later_log(lib, trajectories[k % 2], pi_true, "", seed=20 + k)
        tau = log.tau + 0.2 * rng.standard_normal(lib.n_joints)
        names.append(f"ur-19_10_0{k}.csv")
        write_recording(log.replace(tau=tau, name="ur"), tmp_path / names[-1])
        if k == 3:
            names.append("ur-20.csv")
            gain = np.where(np.arange(lib.n_joints) == 1, 1.08, 1.0)
            write_recording(log.replace(tau=tau * gain, name="ur"), tmp_path / names[-1])
    ran = command("watch", arm, names[3], "--json")
    assert (ran.code, json.loads(ran.out)["group"]) == (1, "sensor bias")
    words = [word for name in names[:3] for word in ("--reference", name)]
    ran = command("watch", arm, *names[3:], *names[:1], *words, "--json")
    clean, gain, known = json.loads(ran.out)["logs"]
    assert [each["log"] for each in (clean, gain)] == ["ur-19_10_03", "ur-20"]
    assert not clean["changed"]
    assert (gain["changed"], gain["group"], gain["where"]) == (True, "sensor gain", "fr3_joint2")
    assert known["p_value"] == 1.0
    assert clean["references"] == 3
    assert "hidden are changes below" in clean["hidden"]


def test_a_body_of_plausible_size_has_a_quarter_of_the_mass(
    lib: Library, arm: Path, pi_true: np.ndarray
) -> None:
    """Oracle: base parameters of a mass m, at 0.2 m and with the inertia m (0.2 m)², in turn."""
    saved = read_result(arm)
    changes = changes_of(lib, model_of(saved, lib), np.ones((2, lib.n_joints)))
    (tool,) = (each for each in hypotheses(lib, changes, pi_true) if each.group == "payload")
    mass = 0.25 * pi_true[::10].sum()
    pi = np.zeros((lib.pi0.size, 10))
    pi[-10:] = np.diag(mass * np.array([1.0, *[0.2] * 3, *[0.04] * 6]))
    moved = np.vstack([np.zeros((len(changes.names), 10)), lib.base_matrix @ pi])
    np.testing.assert_allclose(tool.moved, moved, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(tool.size, mass * np.eye(1, 10)[0])


def test_a_doubted_model_is_no_simulation_of_itself(lib: Library, arm: Path) -> None:
    """Property: friction that no column describes differs by the motion; all usual changes count.

    A simulated quadruped with such friction was called changed after another motion.
    """
    saved = read_result(arm)
    root = read_posterior(arm, saved, lib).root(lib)
    rows = read_test_rows(arm, model_of(saved, lib))
    doubted = dataclasses.replace(saved, record=structs.replace(saved.record, doubts=("friction",)))
    sure, wide = (
        baseline_of(lib, each, root, np.ones(lib.n_joints), rows).usual().scales
        for each in (saved, doubted)
    )
    assert (wide >= sure).all()
    assert wide[0] == pytest.approx(7e-4)  # s of a clock
    assert sure[0] < 0.1 * wide[0]


def test_every_end_of_a_tree_carries_tools(robot: Callable[[str], Library]) -> None:
    """Property: a payload may be at each link that carries no other one, not at the last alone."""
    tree, none = robot("tree"), np.zeros(0, dtype=int)
    nothing = SimpleNamespace(names=(), units=none, of=lambda *_: none)
    parts = hypotheses(tree, nothing, tree.pi0)  # type: ignore[arg-type]
    inner = {tree.link_names[joint.parent] for joint in tree.manifest.joints if joint.parent >= 0}
    ends = [name for name in tree.link_names if name not in inner]
    assert len(ends) > 1
    assert [each.where for each in parts if each.group == "payload"] == ends


def test_three_sensors_are_not_a_wrong_model(
    lib: Library,
    arm: Path,
    trajectories: tuple[Trajectory, ...],
    pi_true: np.ndarray,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Property: where no part explains half, all bodies together do only if they explain more.

    Scores of all changes are apart here, and those of the base parameters are noise.
    """
    saved = read_result(arm)
    root = 1e-6 * np.eye(len(lib.base_matrix) + saved.phi.size)
    baseline = baseline_of(lib, saved, root, np.full(lib.n_joints, NOISE))
    log = prepare(later_log(lib, trajectories[1], pi_true, ""), Preparation(), saved.friction)
    names, width = baseline.changes.names, len(baseline.changes.names) + len(lib.base_matrix)
    z = np.zeros(width)
    for size, name in ((30.0, "fr3_joint1"), (29.0, "fr3_joint3"), (28.0, "fr3_joint6")):
        z[names.index(("sensor gain", name))] = size
    zero = np.zeros((width, 0))
    monkeypatch.setattr(
        drift.scores,
        "scores_of_rows",
        lambda *_: Scores(z, 1e3 * np.eye(width), zero, zero, np.eye(width), 1.0, 99, 1e3),
    )
    monkeypatch.setattr(drift.scores, "expected", lambda *_: (np.zeros(width), np.eye(width)))
    verdict = verdict_of(lib, baseline, log)
    assert (verdict.best.group, verdict.best.where) == ("sensor gain", "fr3_joint1")
    assert [each.where for each in verdict.beside[:2]] == ["fr3_joint3", "fr3_joint6"]


def test_the_interval_holds_the_size_in_95_of_100() -> None:
    """Oracle: 2000 draws of scores with a known change; 4 deviations of a share of 2000.

    The penalty of a coefficient is log N_eff, and a size counts from the corrected level on.
    """
    rng = np.random.default_rng(3)
    column = rng.normal(size=(6, 1))
    part = Hypothesis("sensor bias", "j", np.eye(1), np.array([2.0]), "N·m")
    held = []
    for noise in rng.normal(size=(2000, 6)):
        test = _tested(part, 0.7 * column[:, 0] + noise, column, 1e6, 50.0, 0.01 / 40)
        assert test.interval is not None
        held.append(test.interval[0] < 1.4 < test.interval[1])
    assert np.mean(held) == pytest.approx(0.95, abs=4 * np.sqrt(0.05 * 0.95 / 2000))
    assert test.chi2 - test.score == pytest.approx(np.log(50.0))
    assert test.least is not None
    sigma = 2.0 / np.linalg.norm(column)
    assert 40 * chi2.sf((test.least / sigma) ** 2, 1) == pytest.approx(0.01, rel=1e-3)


def test_what_a_log_does_not_determine_explains_nothing() -> None:
    """Oracle: a change of a plausible size that is half of the noise, alone and beside another."""
    column = np.array([[0.5], [0.0], [0.0]])
    part = Hypothesis("sensor bias", "j", np.eye(1), np.array([2.0]), "N·m")
    y = np.array([40.0, 3.0, 0.0])
    alone = _tested(part, y, column, 1e6, 50.0, 0.01)
    assert (alone.freedom, alone.p_value, alone.size, alone.least) == (0, 1.0, None, None)
    both = dataclasses.replace(part, moved=np.eye(2), size=np.array([0.0, 2.0]))
    second = _tested(both, y, np.hstack([column, [[0.0], [30.0], [0.0]]]), 1e6, 50.0, 0.01)
    assert (second.freedom, second.chi2) == (1, pytest.approx(9.0))
    assert second.size == pytest.approx(2.0 * 3.0 / 30.0)
    tied = dataclasses.replace(both, size=np.array([2.0, 2.0]))
    assert _tested(tied, y, np.hstack([column, column]), 1e6, 50.0, 0.01).size is None


def test_a_p_value_counts_all_hypotheses_and_independent_samples(
    lib: Library, arm: Path, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Oracle: the smallest p-value times the number of hypotheses (Bonferroni), below 1.

    AR(1) noise of ρ = 0.9 leaves one independent sample of 19 where the motion is slow.
    """
    saved = read_result(arm)
    root = 1e-6 * np.eye(len(lib.base_matrix) + saved.phi.size)
    baseline = baseline_of(lib, saved, root, np.full(lib.n_joints, NOISE))
    log = prepare(later_log(lib, trajectories[1], pi_true, ""), Preparation(), saved.friction)
    tau = log.required("tau")
    verdict = verdict_of(lib, baseline, log.replace(tau=tau + 0.02 * np.eye(lib.n_joints)[4]))
    smallest = min(test.p_value for test in verdict.tests)
    assert smallest < 1e-3
    count = len(hypotheses(lib, baseline.changes, saved.pi))
    assert verdict.p_value == pytest.approx(min(1.0, count * smallest))
    assert verdict.n_eff == pytest.approx(len(log), rel=0.45)
    white = np.random.default_rng(4).normal(0, NOISE, tau.shape)
    coloured = np.asarray(lfilter([np.sqrt(1 - 0.81)], [1, -0.9], white, axis=0))
    known = torque_of(lib, samples_of(log, lib), saved.pi, saved.phi)
    later = verdict_of(lib, baseline, log.replace(tau=known + coloured))
    assert len(log) / 30 < later.n_eff < len(log) / 8


def verdict_beside(result: Identification, folder: Path, log: Recording) -> Verdict:
    """Verdict on a later log by the held-out rows of a result."""
    lib = result.lib
    write_result(result, folder, "test")
    saved = read_result(folder)
    model = model_of(saved, lib)
    sigma = np.sqrt(np.mean(read_held_out(folder, model).rest ** 2, axis=0))
    root = read_posterior(folder, saved, lib).of_readings().root(lib)
    baseline = baseline_of(lib, saved, root, sigma, read_test_rows(folder, model))
    return verdict_of(lib, baseline, prepare(log, saved.preparation, result.friction, lib=lib))


@pytest.mark.parametrize("stated", [True, False])
def test_a_delay_that_no_result_estimated_is_no_change(
    lib: Library,
    trajectories: tuple[Trajectory, ...],
    pi_true: np.ndarray,
    tmp_path: Path,
    stated: bool,
) -> None:
    """Property: torques that are late by 15 ms in all logs of an arm are not news of one of them.

    The result states no delay, so that it is unknown; one that is stated to be 0 is known, and the
    same log of another motion has a changed clock.
    """
    motions, logs = trajectories[:2], []
    for seed, motion in enumerate(motions):
        plant = Plant(pi_true, **FRICTION, torque_noise=NOISE)
        log = ideal(lib, motion, plant, rng=np.random.default_rng(seed))
        late = [np.interp(log.t - 0.015, log.t, row) for row in log.tau.T]
        logs.append(log.replace(tau=np.column_stack(late)))
    terms = Friction(("viscous", "coulomb", "offset"), 0.03)
    steps = Preparation(torque_delay_s=1e-9 if stated else None)
    result = identify_recording(logs[0], lib, friction=terms, preparation=steps)
    verdict = verdict_beside(result, tmp_path, logs[1])
    assert verdict.changed == stated
    assert not stated or verdict.best.group == "clock"


@pytest.mark.parametrize(("cutoff_hz", "changes"), [(3.0, False), (20.0, True)])
def test_a_low_pass_in_the_band_of_the_motion_does_not_make_a_simulation(
    lib: Library,
    trajectories: tuple[Trajectory, ...],
    pi_true: np.ndarray,
    tmp_path: Path,
    cutoff_hz: float,
    changes: bool,
) -> None:
    """Property: noise of any colour looks white below 3 Hz; 15 % of friction are usual.

    Behind 20 Hz white noise is seen, as of a simulation, whose friction does not change.
    """
    terms, steps = (
        Friction(("viscous", "coulomb", "offset"), 0.03),
        Preparation(filter="butterworth", cutoff_hz=cutoff_hz),
    )
    logs = []
    for k, change in enumerate((0.0, 0.15)):
        scale = 1 + change * np.array([1, -1, 1, -1, 1, -1, 1])
        friction = {key: scale * value for key, value in FRICTION.items()}
        plant = Plant(pi_true, **friction, torque_noise=NOISE)
        logs.append(ideal(lib, trajectories[k], plant, rng=np.random.default_rng(k)))
    result = identify_recording(logs[0], lib, friction=terms, preparation=steps)
    verdict = verdict_beside(result, tmp_path, logs[1])
    assert verdict.changed == changes, verdict.sentence()
