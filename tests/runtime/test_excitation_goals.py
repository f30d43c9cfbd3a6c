"""runtime.excitation.goals, information and prediction: closed forms, gradients, Monte Carlo."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from runtime import load
from runtime.errors import IdentificationError
from runtime.excitation import (
    ConditionCost,
    Trajectory,
    basis_of,
    covariance_of,
    design,
    information,
    predict,
    torque_band,
)
from runtime.excitation.criteria import Measure, log_variance, log_volume, mixed
from runtime.excitation.goals import CRITERIA, goal, sizes, unseen_torque
from runtime.excitation.prediction import FRICTION, SAMPLES, unseen_rows
from runtime.library import Library
from runtime.prior import prior_information
from runtime.simulation import Plant, ideal
from tests.runtime.conftest import Command
from tests.runtime.trials import assert_variance, errors, pinocchio_rows, with_friction
from tests.taylor import assert_second_order, taylor_slope

DURATION = 10.0


def random_gram(size: int = 6, seed: int = 0) -> np.ndarray:
    rows = np.random.default_rng(seed).normal(size=(30, size)) * np.geomspace(1e-2, 1e2, size)
    return rows.T @ rows


def test_criteria_of_the_covariance_by_scipy() -> None:
    """Oracle: scipy's inverse and eigenvalues; columns that differ by four orders in length."""
    gram, seen = random_gram(), random_gram(seed=1)
    inverse = scipy.linalg.inv(gram)
    assert log_variance(seen)(gram)[0] == pytest.approx(
        np.log(np.trace(seen @ inverse)) / 2, rel=1e-12
    )
    expected = -np.log(scipy.linalg.eigvalsh(gram)).mean() / 2
    # The smallest of scipy's eigenvalues has a relative error of ε times cond² = 1e8.
    assert log_volume(gram)[0] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    "measure",
    [log_variance(random_gram(seed=1)), log_volume, mixed(log_volume, log_variance(np.eye(6)), 2)],
    ids=["variance", "volume", "mixed"],
)
def test_slopes_in_the_gram_matrix_by_taylor(measure: Measure) -> None:
    """Derivative: S = 2 ∂f/∂G along a symmetric direction."""
    gram, direction = random_gram(), 0.1 * random_gram(seed=3)
    slope = float(np.sum(measure(gram)[1] * direction)) / 2
    measured = taylor_slope(lambda x: measure(x)[0], gram, direction, slope)
    assert_second_order(measured, decades=3.5)  # rounding × cond² ends it


@pytest.mark.parametrize("measure", [log_variance(np.eye(3)), log_volume])
def test_no_full_rank_is_infinite(measure: Measure) -> None:
    """Property: ∞ and no slope, for a silent column, equal columns and not a number."""
    rounding = np.eye(3)
    rounding[0, 1] = rounding[1, 0] = 1 - np.finfo(float).eps  # has a factor, but no digits
    nan = np.full((3, 3), np.nan)
    for gram in (np.diag([1.0, 2.0, 0.0]), np.ones((3, 3)), rounding, nan):
        value, slope = measure(gram)
        assert value == np.inf
        assert not slope.any()


CASES = {
    **{name: (name, "cosine", {}) for name in CRITERIA},
    "mixed, fourier": ("mixed", "fourier", {}),
    "a, bspline, σ by joint": ("a", "bspline", {"noise": np.arange(1, 8) / 50}),
    "cond, prior": ("cond", "cosine", {"prior": True}),
    "mixed, prior": ("mixed", "cosine", {"prior": True, "noise": np.arange(1, 8) / 50}),
    "v, payload": ("v", "cosine", {"payload": True}),
    "a, payload, fourier": ("a", "fourier", {"payload": True}),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_gradients_in_the_coefficients_by_taylor(
    lib: Library, trajectories: tuple[Trajectory, ...], case: tuple[str, str, dict]
) -> None:
    """Derivative: criterion, information, regressor and basis together."""
    name, kind, options = case
    if options.get("prior"):
        rows = lib.base_regressor(*trajectories[2].at(lib, np.linspace(1, 4, 50))[:3])
        options = options | {"prior": 100 * np.einsum("tjk,tjl->kl", rows, rows)}
    told = information(lib, **options)
    rng, basis = np.random.default_rng(1), basis_of(kind)
    a = 0.8 * trajectories[1].coefficients
    if kind == "fourier":
        a = np.hstack([a, 0.05 * a])
    if kind == "bspline":
        a = rng.normal(size=(7, 8))
    cost = ConditionCost(lib, lib.home, a.shape[1], DURATION, basis, told)
    target = goal(name, lib, lib.home, told).target
    direction = 0.3 * a * rng.normal(size=a.shape)
    slope = float(np.sum(cost.measure(a, target)[1] * direction))
    measured = taylor_slope(
        lambda x: cost.measure(x.reshape(a.shape), target)[0], a.ravel(), direction.ravel(), slope
    )
    assert_second_order(measured, decades=3.0)  # LAPACK's rounding × cond² of raw columns ends it


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
    told = information(lib, sigma)
    count = len(lib.base_columns)
    found = errors(with_friction(rows[:, :, lib.base_columns], dq, names), sigma, 0)[:, :count]
    spread = covariance_of(lib, trajectories[0], told, names)
    whitened = np.linalg.solve(np.linalg.cholesky(spread), found.T)
    assert_variance(np.sum(whitened**2, axis=0), count, count)
    for k in range(count):
        assert_variance(found[:, k] ** 2, spread[k, k], 1)
    told_all = predict(lib, trajectories[0], told, names)
    # Samples of 1000 and of 1001 equally spaced points: the sum over both differs by 0.3 %.
    assert told_all.sigma_with_friction == pytest.approx(np.sqrt(np.diag(spread)), rel=3e-3)
    score = told_all.scores[-1]
    assert (score.samples, score.columns) == (1000, count + 7 * len(names))
    size = np.maximum(np.abs(lib.base_matrix @ lib.pi0), 0.01)
    # Mean squares: as many degrees of freedom as the weights count, (tr M)² / tr M².
    relative = spread / np.outer(size, size)
    freedom = np.trace(relative) ** 2 / np.sum(relative**2)
    assert_variance(np.mean((found / size) ** 2, axis=1), score.relative_error**2, freedom)
    seen = unseen_torque(lib, lib.home)
    torque = np.einsum("ik,kl,il->i", found, seen, found)
    freedom = np.trace(seen @ spread) ** 2 / np.trace(seen @ spread @ seen @ spread)
    assert_variance(torque, score.torque_error**2, freedom)
    if not names:
        unseen = unseen_rows(lib, lib.home)[::7]
        band = torque_band(lib, spread, *trajectories[1].at(lib, np.array([2.0, 3.3]))[:3])
        there = lib.base_regressor(*trajectories[1].at(lib, np.array([2.0, 3.3]))[:3])
        for j in range(7):
            assert_variance(np.square(there[1, j] @ found.T), band[1, j] ** 2, 1)
            mean = np.mean(np.square(unseen[:, j] @ found.T), axis=0)
            own = unseen[:, j].T @ unseen[:, j] / len(unseen)
            freedom = np.trace(own @ spread) ** 2 / np.trace(own @ spread @ own @ spread)
            # Every seventh sample of the motions stands for all: 5 %.
            assert_variance(mean, np.trace(own @ spread), freedom)
            assert told_all.torque[j] ** 2 == pytest.approx(np.trace(own @ spread), rel=0.05)


def test_payloads_by_monte_carlo(
    lib: Library, trajectories: tuple[Trajectory, ...], at_100_hz: tuple[np.ndarray, ...]
) -> None:
    """Oracle: 200 fits of ten parameters and seven offsets: mass and centre of mass of 1 kg."""
    rows, dq = at_100_hz
    truth = np.zeros(17)
    truth[0], truth[3] = 1.0, 0.1
    payload = with_friction(rows[:, :, -10:], dq, ("offset",))
    found = truth + errors(payload, np.full(7, 0.05), 1)
    told = predict(lib, trajectories[0], information(lib))
    assert told.payload_mass is not None
    assert told.payload_com is not None
    assert_variance((found[:, 0] - 1) ** 2, told.payload_mass**2, 1)
    com = found[:, 1:4] / found[:, :1] - [0.0, 0.0, 0.1]
    for k in range(3):
        assert_variance(com[:, k] ** 2, told.payload_com[k] ** 2, 1)
    alone = predict(lib, trajectories[0], information(lib, payload=True))
    assert alone.payload_only
    free = errors(payload[:, :10], np.full(7, 0.05), 2)
    for k in range(10):
        assert_variance(free[:, k] ** 2, alone.sigma[k] ** 2, 1)


def test_out_and_back_friction_costs_nothing(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Property: inertia is even and friction odd in dq: orthogonal on cosines, not on the rest."""
    told, names = information(lib), ("viscous", "coulomb")
    for motion in trajectories[:2]:
        found = predict(lib, motion, told, names)
        # Rounding × the square of the raw columns' condition number.
        assert found.sigma_with_friction == pytest.approx(found.sigma, rel=1e-8)
    bent = np.random.default_rng(0).normal(size=(7, 10)) * 0.05
    motion = Trajectory(lib.home, bent, DURATION, basis_of("bspline"))
    found = predict(lib, motion, told, names)
    assert found.sigma_with_friction is not None
    assert (found.sigma_with_friction / found.sigma).max() > 1.05


def test_scores_are_those_of_the_cost(lib: Library, trajectories: tuple[Trajectory, ...]) -> None:
    """Property: at 80 samples what the search minimises; cond as the document counts it."""
    told, a = information(lib), trajectories[0].coefficients
    cost = ConditionCost(lib, lib.home, 5, DURATION, information=told)
    scores = predict(lib, trajectories[0], told).scores
    assert [s.samples for s in scores] == [*SAMPLES, *SAMPLES]
    assert [s.columns for s in scores] == [43, 43, 64, 64]
    for name, value in (
        ("a", scores[0].relative_error),
        ("v", scores[0].torque_error),
        ("d", scores[0].half_axis),
        ("cond", scores[0].condition),
    ):
        target = goal(name, lib, lib.home, told).target
        # Rounding × cond² of raw columns.
        assert value == pytest.approx(np.exp(cost.measure(a, target)[0]), rel=1e-8)
    assert np.sqrt(np.sum(predict(lib, trajectories[0], told).torque ** 2)) == pytest.approx(
        scores[1].torque_error, rel=1e-12
    )


def test_earlier_logs_count_as_rows(
    lib: Library, trajectories: tuple[Trajectory, ...], pi_true: np.ndarray
) -> None:
    """Oracle: the covariance of one least-squares problem over both logs, each with friction."""
    sigma = np.linspace(0.02, 0.08, 7)
    log = ideal(lib, trajectories[1], Plant(pi_true, viscous=0.5), rate_hz=50.0)
    told = information(lib, sigma, prior=prior_information(lib, [log, log], sigma))
    found = covariance_of(lib, trajectories[0], told, samples=1000)
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
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-9 * np.abs(expected).max())


def test_each_criterion_is_best_at_its_own(lib: Library) -> None:
    """Property: of four designs from one start each wins where it was meant to."""
    told, kinds = information(lib), ("v", "a", "d", "cond")
    scores = {}
    for name in kinds:
        found = design(lib, 5.0, 4, starts=1, criterion=name, information=told)
        scores[name] = predict(lib, found.trajectory, told, ()).scores[0]
        assert found.criterion == name
    by = {
        "v": lambda s: s.torque_error,
        "a": lambda s: s.relative_error,
        "d": lambda s: s.half_axis,
        "cond": lambda s: s.condition,
    }
    for name in kinds:
        values = {other: by[name](scores[other]) for other in kinds}
        assert min(values, key=lambda key: values[key]) == name, (name, values)


def test_mixed_gives_good_predictions_and_a_good_condition_number(lib: Library) -> None:
    """Property: M = 5, 10 s; V-opt alone has cond 8, log cond alone 12 mN·m and more."""
    found = design(lib, criterion="mixed", information=information(lib), starts=2)
    score = predict(lib, found.trajectory, information(lib), ()).scores[0]
    # Measured: 4.36, 2.7 %, 8.2 mN·m from two starts; 4.97, 1.97 %, 7.0 from 24.
    assert found.condition < 5.5
    assert score.relative_error < 0.03
    assert score.torque_error < 0.0085


def test_sizes_and_payload_columns(lib: Library, at_100_hz: tuple[np.ndarray, ...]) -> None:
    """Oracle: Pinocchio's last ten columns are our base regressor times T; sizes never vanish."""
    told = information(lib, payload=True)
    rows = at_100_hz[0][::50]
    ours = rows[:, :, lib.base_columns] @ told.columns
    assert ours == pytest.approx(rows[:, :, -10:], abs=1e-11)
    assert sizes(lib, information(lib)).min() == 0.01
    assert sizes(lib, told) == pytest.approx([1, 0.1, 0.1, 0.1, *6 * [0.01]])


def test_more_unknowns_than_the_motion_excites(
    lib: Library, tiny_built: Path, trajectories: tuple[Trajectory, ...]
) -> None:
    """Property: a payload on a pendulum, a joint that rests: one sentence each, with numbers."""
    pendulum = load(tiny_built)
    told = information(pendulum, payload=True)
    with pytest.raises(IdentificationError, match=r"excites 3 of 10 unknown columns; raise"):
        design(pendulum, 4.0, 2, starts=1, criterion="a", information=told)
    a = trajectories[0].coefficients.copy()
    a[6] = 0.0
    # The others turn link 7 enough, but a joint that rests has no friction to tell.
    found = predict(lib, Trajectory(lib.home, a, DURATION), information(lib))
    assert found.sigma_with_friction is None
    assert [score.friction for score in found.scores] == [(), ()]
    expected = "with friction viscous, coulomb, offset: the motion .* excites 62 of 64 unknown"
    assert re.match(expected, found.notes[0])
    a[1:] = 0.0
    with pytest.raises(IdentificationError, match=r"\(5 functions per joint\) excites \d+ of 43"):
        predict(lib, Trajectory(lib.home, a, DURATION), information(lib))


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"noise": 0.0}, "torque noise above 0"),
        ({"noise": np.nan}, "torque noise above 0"),
        ({"noise": np.ones(3)}, "one number or 7 of them"),
        ({"rate": 0.0}, "sampling rate above 0 Hz, got 0"),
        ({"prior": np.ones((2, 2))}, r"shape \(43, 43\)"),
    ],
)
def test_information_that_is_none(lib: Library, options: dict, match: str) -> None:
    """Property: one sentence."""
    with pytest.raises(IdentificationError, match=match):
        information(lib, **options)


def test_criteria_that_are_none(lib: Library) -> None:
    """Property: one sentence, before anything is searched."""
    with pytest.raises(IdentificationError, match=r"no criterion 'e'; choose from v, a, d, cond"):
        design(lib, criterion="e", information=information(lib))
    with pytest.raises(IdentificationError, match="'v' needs to know the torque noise"):
        design(lib, criterion="v")


def test_excite_tells_what_to_expect(command: Command, lib: Library, tmp_path: Path) -> None:
    """Property: the options reach the design, its file and the table."""
    words = ("--duration", "4", "--harmonics", "3", "--starts", "1", "--rate", "100")
    first = command("excite", "--robot", lib.folder, *words, "--document", "--out", "a.json")
    assert first.code == 0, first.err
    facts = json.loads((tmp_path / "a.json").read_text())
    assert (facts["criterion"], facts["basis_name"]) == ("cond", "cosine")
    log = tmp_path / "log.csv"
    assert command(
        *("simulate", "--robot", lib.folder, "--trajectory", "a.json", "--rate", "100"),
        *("--out", log),
    ).code == 0  # fmt: skip
    more = ("--basis", "bspline", "--zero-jerk", "--noise", "0.02", "--prior", log, "--log-rate")
    ran = command("excite", "--robot", lib.folder, *words, *more, "200", "--out", "b.json")
    assert ran.code == 0, ran.err
    assert "with earlier logs" in ran.out
    assert "64 = base + friction" in ran.out
    assert "a payload of 1 kg on a known arm: mass to ±" in ran.out
    facts = json.loads((tmp_path / "b.json").read_text())
    assert (facts["criterion"], facts["basis_name"]) == ("mixed", "bspline")
    assert facts["zero_jerk_at_ends"] is True
    told = facts["prediction"]
    assert (told["rate_hz"], told["torque_noise"]) == (200.0, [0.02] * 7)
    assert len(told["sigma"]) == 43
    assert [entry["samples"] for entry in told["criteria"]] == [80, 1000, 80, 1000]


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (("--criterion", "best"), "no criterion 'best'"),
        (("--basis", "wavelet"), "no basis 'wavelet'"),
        (("--noise", "0"), "torque noise above 0"),
        (("--noise", "1,2"), "--noise needs 7 numbers"),
        (("--log-rate", "-1"), "sampling rate above 0 Hz"),
        (("--prior", "nowhere.csv"), "nowhere.csv"),
    ],
)
def test_bad_options(
    command: Command, lib: Library, tmp_path: Path, words: tuple[str, ...], match: str
) -> None:
    """Property: one sentence, code 2, no file."""
    ran = command("excite", "--robot", lib.folder, "--starts", "1", *words)
    assert ran.code == 2
    assert match in ran.err
    assert len(ran.err.splitlines()) == 1
    assert not list(tmp_path.iterdir())
