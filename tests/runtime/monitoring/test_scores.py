"""Scores of a log: rests, torque of other shapes, and the usual change that references show."""

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.estimators.regression.model_error import SHAPES
from runtime.monitoring.scores import (
    ChangedRows,
    Changes,
    Scores,
    Usual,
    _at_rest,
    expected,
    period_of,
    scores_of_rows,
    usual_of,
)


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
