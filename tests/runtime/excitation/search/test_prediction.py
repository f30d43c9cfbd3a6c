"""runtime.excitation.search.prediction: Monte Carlo over logs, earlier logs, unseen columns."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from runtime import load
from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.excitation.search.criteria import sizes, unseen_rows, unseen_torque
from runtime.excitation.search.design import design
from runtime.excitation.search.information import FRICTION, information
from runtime.excitation.search.prediction import MOST_SAMPLES, covariance_of, predict
from runtime.identification.expected_accuracy.planned_samples import information_of_logs
from runtime.library import Library
from runtime.simulation import Plant, ideal
from tests.runtime.conftest import Command
from tests.runtime.trials import assert_variance, errors, pinocchio_rows, with_friction

DURATION = 10.0
TRIALS = 200


def test_samples_of_a_long_log_are_bounded(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Property: a log of hours is counted by `MOST_SAMPLES` rows; 1000 s at 100 Hz took 0.4 GB.

    One more sample than half of them changes the mean of the rows by 1e-4 of itself.
    """
    fast = information(lib, 0.05, rate=3 * MOST_SAMPLES / DURATION)
    spread = covariance_of(lib, trajectories[0], fast)
    same = covariance_of(lib, trajectories[0], fast, samples=MOST_SAMPLES)
    np.testing.assert_array_equal(spread, same)
    near = covariance_of(lib, trajectories[0], fast, samples=MOST_SAMPLES // 2)
    assert np.diag(near) == pytest.approx(np.diag(spread), rel=1e-3)


@pytest.fixture(scope="module")
def at_100_hz(lib: Library, trajectories: tuple[Trajectory, ...]) -> tuple[np.ndarray, ...]:
    """Pinocchio's rows and dq along the first trajectory as a log has them."""
    t = np.arange(1001) / 100
    return pinocchio_rows(lib, trajectories[0], t), trajectories[0].at(lib, t)[1]


@pytest.mark.parametrize("names", [(), FRICTION], ids=["alone", "with friction"])
def test_prediction_by_monte_carlo(
    lib: Library,
    trajectories: tuple[Trajectory, ...],
    at_100_hz: tuple[np.ndarray, ...],
    names: tuple[str, ...],
) -> None:
    """Oracle: 200 fits by numpy's least squares to Pinocchio's regressor with simulated noise."""
    rows, dq = at_100_hz
    sigma = np.array([0.05, 0.05, 0.08, 0.05, 0.02, 0.05, 0.01])
    reports = information(lib, sigma)
    count = len(lib.base_columns)
    result = errors(with_friction(rows[:, :, lib.base_columns], dq, names), sigma, 0)[:, :count]
    spread = covariance_of(lib, trajectories[0], reports, names)
    whitened = np.linalg.solve(np.linalg.cholesky(spread), result.T)
    assert_variance(np.sum(whitened**2, axis=0), count, count)
    for k in range(count):
        assert_variance(result[:, k] ** 2, spread[k, k], 1)
    reported_all = predict(lib, trajectories[0], reports, names)
    # Samples of 1000 and of 1001 equally spaced points: the sum over both differs by 0.3 %.
    assert reported_all.sigma_with_friction == pytest.approx(np.sqrt(np.diag(spread)), rel=3e-3)
    score = reported_all.scores[-1]
    assert (score.samples, score.columns) == (1000, count + 7 * len(names))
    size = np.maximum(np.abs(lib.base_matrix @ lib.pi0), 0.01)
    # Mean squares: as many degrees of freedom as the weights count, (tr M)² / tr M².
    relative = spread / np.outer(size, size)
    freedom = np.trace(relative) ** 2 / np.sum(relative**2)
    assert_variance(np.mean((result / size) ** 2, axis=1), score.relative_error**2, freedom)
    seen = unseen_torque(lib, lib.home)
    torque = np.einsum("ik,kl,il->i", result, seen, result)
    freedom = np.trace(seen @ spread) ** 2 / np.trace(seen @ spread @ seen @ spread)
    assert_variance(torque, score.torque_error**2, freedom)
    if not names:
        unseen = unseen_rows(lib, lib.home)[::7]
        there = lib.base_regressor(*trajectories[1].at(lib, np.array([2.0, 3.3]))[:3])
        for j in range(7):
            assert_variance(
                np.square(there[1, j] @ result.T), there[1, j] @ spread @ there[1, j], 1
            )
            mean = np.mean(np.square(unseen[:, j] @ result.T), axis=0)
            single = unseen[:, j].T @ unseen[:, j] / len(unseen)
            freedom = np.trace(single @ spread) ** 2 / np.trace(single @ spread @ single @ spread)
            # Every seventh sample of the motions stands for all: 5 %.
            assert_variance(mean, np.trace(single @ spread), freedom)
            assert reported_all.torque[j] ** 2 == pytest.approx(np.trace(single @ spread), rel=0.05)


def test_payloads_by_monte_carlo(
    lib: Library, trajectories: tuple[Trajectory, ...], at_100_hz: tuple[np.ndarray, ...]
) -> None:
    """Oracle: 200 fits of ten parameters and seven offsets: mass and centre of mass of 1 kg."""
    rows, dq = at_100_hz
    truth = np.zeros(17)
    truth[0], truth[3] = 1.0, 0.1
    payload = with_friction(rows[:, :, -10:], dq, ("offset",))
    result = truth + errors(payload, np.full(7, 0.05), 1)
    reports = predict(lib, trajectories[0], information(lib))
    assert reports.payload_mass is not None
    assert reports.payload_com is not None
    assert_variance((result[:, 0] - 1) ** 2, reports.payload_mass**2, 1)
    com = result[:, 1:4] / result[:, :1] - [0.0, 0.0, 0.1]
    for k in range(3):
        assert_variance(com[:, k] ** 2, reports.payload_com[k] ** 2, 1)
    alone = predict(lib, trajectories[0], information(lib, payload=True))
    assert alone.payload_only
    free = errors(payload[:, :10], np.full(7, 0.05), 2)
    for k in range(10):
        assert_variance(free[:, k] ** 2, alone.sigma[k] ** 2, 1)


def test_earlier_logs_count_as_rows(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Oracle: the covariance of one least-squares problem over both logs, each with friction."""
    sigma = np.linspace(0.02, 0.08, 7)
    log = ideal(lib, trajectories[1], Plant(pi_true, viscous=0.5), rate_hz=50.0)
    reports = information(lib, sigma, earlier=information_of_logs(lib, [log, log], sigma))
    result = covariance_of(lib, trajectories[0], reports, samples=1000)
    parts = []
    for motion, times, repeat, names in (
        (trajectories[1], log.t, 1, FRICTION),
        (trajectories[1], log.t, 1, FRICTION),
        (trajectories[0], np.linspace(0, DURATION, 1000), 1, ()),
    ):
        state = motion.at(lib, times)[:3]
        rows = with_friction(lib.base_regressor(*state), state[1], names)
        rows = rows / np.tile(sigma, len(times))[:, None]
        parts.append(np.repeat(rows, repeat, axis=0))
    widths = [part.shape[1] - 43 for part in parts]
    whole = np.zeros((sum(map(len, parts)), 43 + sum(widths)))
    row, column = 0, 43
    for part, width in zip(parts, widths, strict=True):
        whole[row : row + len(part), :43] = part[:, :43]
        whole[row : row + len(part), column : column + width] = part[:, 43:]
        row, column = row + len(part), column + width
    expected = np.linalg.inv(whole.T @ whole)[:43, :43]
    # Rounding × the square of the raw columns' condition number.
    assert result == pytest.approx(expected, rel=1e-6, abs=1e-9 * np.abs(expected).max())


def test_sizes_and_payload_columns(lib: Library, at_100_hz: tuple[np.ndarray, ...]) -> None:
    """Oracle: Pinocchio's last ten columns are our base regressor times T; sizes never vanish."""
    reports = information(lib, payload=True)
    rows = at_100_hz[0][::50]
    ours = rows[:, :, lib.base_columns] @ reports.columns
    assert ours == pytest.approx(rows[:, :, -10:], abs=1e-11)
    assert sizes(lib, information(lib)).min() == 0.01
    assert sizes(lib, reports) == pytest.approx([1, 0.1, 0.1, 0.1, *6 * [0.01]])


def test_more_unknowns_than_the_motion_excites(
    lib: Library, tiny_built: Path, trajectories: tuple[Trajectory, ...]
) -> None:
    """Property: a payload on a pendulum, a joint that rests: one sentence each, with numbers."""
    pendulum = load(tiny_built)
    reports = information(pendulum, payload=True)
    with pytest.raises(IdentificationError, match=r"excites 3 of 10 unknown columns; raise"):
        design(pendulum, duration=4.0, harmonics=2, starts=1, criterion="a", information=reports)
    a = trajectories[0].coefficients.copy()
    a[6] = 0.0
    # The others turn link 7 enough, but a joint that rests has no friction to tell.
    result = predict(lib, Trajectory(lib.home, a, DURATION), information(lib))
    assert result.sigma_with_friction is None
    assert [score.friction for score in result.scores] == [(), ()]
    expected = "with friction viscous, coulomb, offset: the motion .* excites 62 of 64 unknown"
    assert re.match(expected, result.notes[0])
    a[1:] = 0.0
    with pytest.raises(IdentificationError, match=r"\(5 functions per joint\) excites \d+ of 43"):
        predict(lib, Trajectory(lib.home, a, DURATION), information(lib))


def test_excite_tells_what_to_expect(command: Command, lib: Library, tmp_path: Path) -> None:
    """Property: the options reach the design, its file and the table."""
    words = (
        "--duration",
        "4",
        "--settings",
        "harmonics=3",
        "--settings",
        "starts=1",
        "--settings",
        "export_rate=100",
    )
    first = command(
        "excite", "--robot", lib.folder, *words, "--settings", "document=true", "--out", "a.json"
    )
    assert first.code == 0, first.err
    facts = json.loads((tmp_path / "a.json").read_text())
    assert (facts["criterion"], facts["basis_name"]) == ("cond", "cosine")
    log = tmp_path / "log.csv"
    assert command(
        *("simulate", "--robot", lib.folder, "--trajectory", "a.json"),
        *("--settings", "control_rate=100"),
        *("--out", log),
    ).code == 0  # fmt: skip
    more = (
        "--settings",
        "basis=bspline",
        "--settings",
        "zero_jerk=true",
        "--noise",
        "0.02",
        "--settings",
        f"earlier_log={log}",
        "--settings",
        "log_rate=200",
    )
    ran = command("excite", "--robot", lib.folder, *words, *more, "--out", "b.json")
    assert ran.code == 0, ran.err
    assert "with earlier logs" in ran.out
    assert "64 = base + friction" in ran.out
    assert "a payload of 1 kg on a known arm: mass to ±" in ran.out
    facts = json.loads((tmp_path / "b.json").read_text())
    assert (facts["criterion"], facts["basis_name"]) == ("mixed", "bspline")
    assert facts["zero_jerk_at_ends"] is True
    reports = facts["prediction"]
    assert (reports["rate_hz"], reports["torque_noise"]) == (200.0, [0.02] * 7)
    assert len(reports["sigma"]) == 43
    assert [entry["samples"] for entry in reports["criteria"]] == [80, 1000, 80, 1000]
