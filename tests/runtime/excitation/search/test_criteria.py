"""criteria and information: closed forms, gradients, what each criterion is for."""

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from runtime.errors import IdentificationError
from runtime.excitation import ConditionCost, Trajectory, basis_of, design, information, predict
from runtime.excitation.search.criteria import CRITERIA
from runtime.excitation.search.measures import Measure, log_variance, log_volume, mixed
from runtime.excitation.search.prediction import SAMPLES
from runtime.library import Library
from tests.runtime.conftest import Command
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
        options = {
            "noise": options.get("noise", 0.05),
            "earlier": 100 * np.einsum("tjk,tjl->kl", rows, rows),
        }
    known = information(lib, **options)
    rng, basis = np.random.default_rng(1), basis_of(kind)
    a = 0.8 * trajectories[1].coefficients
    if kind == "fourier":
        a = np.hstack([a, 0.05 * a])
    if kind == "bspline":
        a = rng.normal(size=(7, 8))
    cost = ConditionCost(lib, lib.home, a.shape[1], DURATION, basis, known)
    target = CRITERIA[name].goal(lib, lib.home, known).target
    direction = 0.3 * a * rng.normal(size=a.shape)
    slope = float(np.sum(cost.measure(a, target)[1] * direction))
    measured = taylor_slope(
        lambda x: cost.measure(x.reshape(a.shape), target)[0], a.ravel(), direction.ravel(), slope
    )
    assert_second_order(measured, decades=3.0)  # LAPACK's rounding × cond² of raw columns ends it


def test_out_and_back_friction_costs_nothing(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Property: inertia is even and friction odd in dq: orthogonal on cosines, not on the rest."""
    known, names = information(lib), ("viscous", "coulomb")
    for motion in trajectories[:2]:
        result = predict(lib, motion, known, names)
        # Rounding × the square of the raw columns' condition number.
        assert result.sigma_with_friction == pytest.approx(result.sigma, rel=1e-8)
    bent = np.random.default_rng(0).normal(size=(7, 10)) * 0.05
    motion = Trajectory(lib.home, bent, DURATION, basis_of("bspline"))
    result = predict(lib, motion, known, names)
    assert result.sigma_with_friction is not None
    assert (result.sigma_with_friction / result.sigma).max() > 1.05


def test_scores_are_those_of_the_cost(lib: Library, trajectories: tuple[Trajectory, ...]) -> None:
    """Property: at 80 samples what the search minimises; cond as the document counts it."""
    known, a = information(lib), trajectories[0].coefficients
    cost = ConditionCost(lib, lib.home, 5, DURATION, information=known)
    scores = predict(lib, trajectories[0], known).scores
    assert [s.samples for s in scores] == [*SAMPLES, *SAMPLES]
    assert [s.columns for s in scores] == [43, 43, 64, 64]
    for name, value in (
        ("a", scores[0].relative_error),
        ("v", scores[0].torque_error),
        ("d", scores[0].half_axis),
        ("cond", scores[0].condition),
    ):
        target = CRITERIA[name].goal(lib, lib.home, known).target
        # Rounding × cond² of raw columns.
        assert value == pytest.approx(np.exp(cost.measure(a, target)[0]), rel=1e-8)
    assert np.sqrt(np.sum(predict(lib, trajectories[0], known).torque ** 2)) == pytest.approx(
        scores[1].torque_error, rel=1e-12
    )


def test_each_criterion_is_best_by_its_measure(lib: Library) -> None:
    """Property: of four designs from one start each wins where it was meant to."""
    known, kinds = information(lib), ("v", "a", "d", "cond")
    scores = {}
    for name in kinds:
        result = design(lib, duration=5.0, harmonics=4, starts=1, criterion=name, information=known)
        scores[name] = predict(lib, result.trajectory, known, ()).scores[0]
        assert result.criterion == name
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
    result = design(lib, criterion="mixed", information=information(lib), starts=2)
    score = predict(lib, result.trajectory, information(lib), ()).scores[0]
    # Measured: 4.36, 2.7 %, 8.2 mN·m from two starts; 4.97, 1.97 %, 7.0 from 24.
    assert result.condition < 5.5
    assert score.relative_error < 0.03
    assert score.torque_error < 0.0085


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"noise": 0.0}, "torque noise above 0"),
        ({"noise": np.nan}, "torque noise above 0"),
        ({"noise": np.ones(3)}, "one number or 7 of them"),
        ({"rate": 0.0}, "sampling rate above 0 Hz, got 0"),
        ({"earlier": np.ones((2, 2))}, r"shape \(43, 43\)"),
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


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (("--criterion", "best"), "no criterion 'best'"),
        (("--basis", "wavelet"), "no basis 'wavelet'"),
        (("--noise", "0"), "torque noise above 0"),
        (("--noise", "1,2"), "--noise needs 7 numbers"),
        (("--log-rate", "-1"), "sampling rate above 0 Hz"),
        (("--earlier-log", "nowhere.csv"), "nowhere.csv"),
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
