"""Scores of a log: rests, torque of other shapes, and the usual change that references show."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.estimators.regression.model_error import SHAPES
from runtime.estimators.regression.samples import samples_of
from runtime.excitation import Trajectory
from runtime.identification.saved_result import read_result
from runtime.library import Library
from runtime.monitoring.model import model_of
from runtime.monitoring.scores import (
    USUAL,
    ChangedRows,
    Changes,
    Scores,
    Usual,
    _at_rest,
    changed_rows,
    changes_of,
    expected,
    period_of,
    scores_of_rows,
    usual_of,
)
from runtime.recording import Friction, Preparation
from runtime.recording.preprocessing import prepare
from tests.runtime.monitoring.later_logs import later_log


def test_a_joint_at_rest_holds_a_torque_within_its_dry_friction() -> None:
    """Oracle: rows of two of three times at rest; the third is short."""
    t = np.arange(100) / 100
    rests = np.zeros((100, 2), bool)
    rests[:30, 1] = rests[40:45, 1] = rests[60:, 1] = True
    assert _at_rest(t, rests) == [(1, slice(0, 30)), (1, slice(60, 100))]


def test_other_shapes_are_relative_to_the_range_of_a_joint() -> None:
    """Oracle: the scores of a nuisance of 0.3 % of a range of 20 N·m, by hand."""
    shape = np.arange(2.0 * 2 * SHAPES).reshape(2, -1)
    changes = Changes((("clock", ""),), np.ones(1), (("ms", 1e3),), np.array([5.0, 20.0]))
    scores = Scores(np.zeros(2), np.ones((2, 1)), np.ones((2, 1)), shape, np.eye(2), 1.0, 9, 99.0)
    mean = np.zeros(2 + 2 * SHAPES)
    mean[-1] = 0.003
    usual = Usual(np.zeros(9), mean, np.zeros((len(mean), len(mean))), 20.0, 0)
    found, spread = expected(changes, usual, scores)
    np.testing.assert_allclose(found, 0.06 * shape[:, -1], rtol=1e-12)
    np.testing.assert_array_equal(spread, np.eye(2))


def waves(rng: np.random.Generator, t: np.ndarray, hz: np.ndarray, *shape: int) -> np.ndarray:
    """Random sums of waves of these frequencies, (N, *shape)."""
    phase = rng.uniform(0, 2 * np.pi, (len(hz), *shape))
    angle = 2 * np.pi * np.multiply.outer(t, hz)
    return np.sum(np.sin(angle[(..., *[None] * len(shape))] + phase), axis=1)


def test_period_of_a_motion() -> None:
    """Oracle: harmonics of 0.2 Hz, read with noise, and frequencies without a common one."""
    rng, t = np.random.default_rng(0), np.arange(1300) / 100
    returns = waves(rng, t, 0.2 * np.arange(1, 6), 3) + 1e-3 * rng.normal(size=(1300, 3))
    returns[:, 2] = 0.4 + 1e-6 * rng.normal(size=1300)  # a joint that rests
    assert abs(period_of(returns) - 500) <= 1
    assert period_of(waves(rng, t, rng.uniform(0.1, 1.0, 5), 3)) == 0
    assert period_of(np.zeros((1300, 3))) == 0


def test_misfit_that_returns_with_a_motion() -> None:
    """Oracle: the scatter of scores over 60 draws of misfit, the same in each of three periods.

    Rows that count as independent have a third of it.
    """
    rng, t = np.random.default_rng(1), np.arange(1800) / 100
    known, ratio, hz = np.zeros((1800, 2, 1)), [], np.arange(1, 31) / 6
    for _ in range(60):
        columns, rest = waves(rng, t, hz, 2, 10), waves(rng, t, hz, 2)
        rows = ChangedRows(
            t, rest, 0.0, columns, known, np.zeros((1800, 2, 0)), 180, 1.0, period=600
        )
        scores = scores_of_rows(rows, np.eye(1))
        ratio.append(float(scores.z @ scores.z) / float(np.trace(scores.noise)))
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.2)


def test_sizes_in_a_short_log_have_the_noise_of_their_joint() -> None:
    """Oracle: scatter of changes of single joints over 100 draws of noise, 5 blocks each.

    The noise is white at one joint, at the other half of it beside fast noise. Means of 600 squares
    scatter by .1, and few blocks add .2. One density of both joints, beside half of the scatter of
    the blocks, gives 2.6 and .93.
    """
    rng, t = np.random.default_rng(2), np.arange(1000) / 100
    columns = np.zeros((1000, 2, 12))
    for joint in range(2):
        columns[:, joint, 6 * joint : 6 * joint + 6] = waves(rng, t, np.arange(1, 21) / 10, 6)
    known, squares = np.zeros((1000, 2, 1)), []
    for _ in range(100):
        white = rng.normal(size=(1001, 3))
        fast = 0.6 * np.diff(white[:, 2])
        rest = np.column_stack([white[1:, 0], 0.5 * white[1:, 1] + fast])
        rows = ChangedRows(t, rest, 0.0, columns, known, np.zeros((1000, 2, 0)), 60, 1.0)
        scores = scores_of_rows(rows, np.eye(1))
        weighted = np.linalg.solve(scores.noise, scores.columns)
        power = np.einsum("ij,ij->j", scores.columns, weighted)
        squares.append((scores.z @ weighted) ** 2 / power)
    means = np.mean(np.reshape(squares, (-1, 2, 6)), axis=(0, 2))
    assert means == pytest.approx([1.0, 1.0], abs=0.35)


@pytest.mark.parametrize("far", 10.0 ** np.arange(2, 16))
@pytest.mark.parametrize("seed", range(3))
def test_references_far_from_the_model_are_refused(far: float, seed: int) -> None:
    """Property: a sentence wherever the search ends, or where it leaves the range of numbers."""
    rng = np.random.default_rng(seed)
    changes = Changes((("clock", ""),), np.ones(1), (("ms", 1e3),), np.zeros(0))
    logs = [
        Scores(
            far * rng.normal(size=4), rng.normal(size=(4, 1)), 1e-3 * rng.normal(size=(4, 2)),
            np.zeros((4, 0)), 1e-6 * np.eye(4), 1.0, 10, 100.0,
        )
        for _ in range(3)
    ]  # fmt: skip
    with pytest.raises(IdentificationError, match="so far from the model"):
        usual_of(changes, 2, [], logs)


@pytest.mark.parametrize(("own", "later", "share"), [(1.2, 5.0, 1.0), (1.2, 0.9, 0.1), (3, 1, 1)])
def test_the_larger_misfit_of_two_logs_makes_the_usual_change(
    own: float, later: float, share: float
) -> None:
    """Property: columns take up the misfit of 3 s of held-out rows, but not that of a later log.

    Of 16 simulated arms with friction that no column describes the held-out rows of 8 s of training
    show 1.1 to 1.8, logs of 20 s on other days 5 to 7.
    """
    changes = Changes((("clock", ""),), np.ones(1), (("ms", 1e3),), np.zeros(0))
    rng = np.random.default_rng(0)
    z, columns, error = (rng.normal(size=(4, k)) for k in (1, 1, 2))
    held_out, seen = (
        Scores(z[:, 0], columns, error, np.zeros((4, 0)), np.eye(4), misfit, 2, 100.0)
        for misfit in (own, later)
    )
    usual = usual_of(changes, 2, [held_out], [], later=[seen])
    assert usual.scales[0] == pytest.approx(share * USUAL["clock"])


def test_a_drift_rises_by_its_size_over_the_log(
    lib: Library, arm: Path, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Oracle: lengths of the columns of a bias and of a ramp from −½ to ½, of N even rows over σ.

    Scores are in a basis of all columns, which keeps their lengths.
    """
    saved = read_result(arm)
    log = prepare(later_log(lib, trajectories[1], pi_true, ""), Preparation(), saved.friction)
    log, model = log.take(slice(0, 200), "short"), model_of(saved, lib)
    root, over = 1e-6 * np.eye(len(lib.base_matrix) + saved.phi.size), np.arange(1.0, 8.0)
    samples, ranges = samples_of(log, lib), np.ones(lib.n_joints)
    rows = changed_rows(lib, model, saved.pi, log.t, samples, over, ranges)
    scores = scores_of_rows(rows, root)
    lengths = np.linalg.norm(scores.columns, axis=0)
    names = changes_of(lib, model, np.ones((2, lib.n_joints))).names
    for kind, column in (("bias", np.ones(200)), ("drift", np.linspace(-0.5, 0.5, 200))):
        for j, joint in enumerate(lib.joint_names):
            found = lengths[names.index((f"sensor {kind}", joint))]
            assert found == pytest.approx(over[j] * np.linalg.norm(column), rel=1e-4)


def test_a_rest_adds_the_square_of_its_dry_friction(
    lib: Library, arm: Path, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Oracle: noise of scores of frictions F, 2 F and 3 F: (9 − 1)/(4 − 1) between the changes."""
    saved = read_result(arm)
    log = prepare(later_log(lib, trajectories[1], pi_true, ""), Preparation(), saved.friction)
    samples = samples_of(log, lib)
    still = samples.dq.copy()
    still[100:400, 2] = 0.0
    samples = dataclasses.replace(samples, dq=still)
    model = dataclasses.replace(model_of(saved, lib), phi=np.zeros_like(saved.phi))  # F is unknown
    root, over = 1e-6 * np.eye(len(lib.base_matrix) + saved.phi.size), np.full(lib.n_joints, 20.0)
    rows = (
        changed_rows(lib, model, saved.pi, log.t, samples, over, k * np.ones(lib.n_joints))
        for k in (1, 2, 3)
    )
    one, two, three = (scores_of_rows(each, root).noise for each in rows)
    assert np.abs(two - one).max() > 0
    np.testing.assert_allclose(three - one, 8 / 3 * (two - one), atol=1e-9 * np.abs(one).max())


def test_a_delay_is_not_read_next_to_a_rest(
    lib: Library, arm: Path, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Property: dry friction turns round before a joint leaves its rest; no delay explains it."""
    saved = read_result(arm)
    log = prepare(later_log(lib, trajectories[1], pi_true, ""), Preparation(), saved.friction)
    moves = samples_of(log, lib)
    still = moves.dq.copy()
    still[100:400, 2] = 0.0
    rests = dataclasses.replace(moves, dq=still)
    given = (np.full(lib.n_joints, 20.0), np.ones(lib.n_joints))
    at_rest, moving = (
        changed_rows(lib, model_of(saved, lib), saved.pi, log.t, samples, *given).columns[:, 2, 0]
        for samples in (rests, moves)
    )
    near = (log.t > log.t[100] - 0.1) & (log.t < log.t[399] + 0.1)
    assert not at_rest[near].any()
    assert np.abs(moving[near]).max() > 1.0
    far = np.abs(log.t[:, None] - log.t[[100, 399]]).min(axis=1) > 0.2
    np.testing.assert_array_equal(at_rest[far & ~near], moving[far & ~near])


def test_the_first_state_of_friction_with_a_memory_is_unknown(
    lib: Library, arm: Path, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Oracle: noise of scores of a joint that rests from the start is F² over all of its rows."""
    saved = read_result(arm)
    log = prepare(later_log(lib, trajectories[1], pi_true, ""), Preparation(), saved.friction)
    samples, over = samples_of(log, lib), np.full(lib.n_joints, 20.0)
    q = samples.q.copy()
    q[:, 2] = 0.3
    samples, plain = dataclasses.replace(samples, q=q), model_of(saved, lib)
    model = dataclasses.replace(plain, terms=Friction(("viscous", "dahl", "offset")))
    size = abs(model.phi[2, 1]) * over[2]
    rows = changed_rows(lib, model, saved.pi, log.t, samples, over, np.ones(lib.n_joints))
    assert rows.sessions is not None
    np.testing.assert_allclose(rows.sessions[:, 2, 2], size, rtol=1e-12)
    stroke = model.terms.dahl_stroke
    span = np.ptp(q[:40, 1])
    expected = abs(model.phi[1, 1]) * over[1] * np.exp(-span / stroke)
    np.testing.assert_allclose(rows.sessions[39, 1, 1], expected, rtol=1e-12)
    root = 1e-6 * np.eye(len(lib.base_matrix) + saved.phi.size)
    without = scores_of_rows(dataclasses.replace(rows, sessions=None), root).noise
    added = scores_of_rows(rows, root).noise - without
    assert np.trace(added) <= np.sum(rows.sessions**2) * (1 + 1e-9)
    assert np.linalg.eigvalsh(added)[-1] > 0.5 * size**2 * len(q)
