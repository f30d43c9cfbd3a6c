"""criteria and information: closed forms, gradients, what each criterion is for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from runtime.errors import IdentificationError, RecordingError
from runtime.excitation import ConditionCost, Trajectory
from runtime.excitation.motion.trajectory import basis_of
from runtime.excitation.search.criteria import (
    CRITERIA,
    log_variance,
    log_volume,
    unseen_torque,
    weighted,
)
from runtime.excitation.search.design import design
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import (
    FRICTION,
    INFORMED_SAMPLES,
    Measure,
    even_columns,
    information,
)
from runtime.excitation.search.prediction import SAMPLES, covariance_of, predict
from runtime.excitation.search.single_start import Search
from runtime.library import Array, Library
from tests.runtime.conftest import Command
from tests.taylor import TaylorSlope, assert_second_order, taylor_slope

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
    [
        log_variance(random_gram(seed=1)),
        log_volume,
        weighted((1.0, log_volume), (2.0, log_variance(np.eye(6)))),
    ],
    ids=["variance", "volume", "weighted"],
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
    gradient = cost.measure(a, target)[1]

    def along(direction: Array) -> TaylorSlope:
        slope = float(np.sum(gradient * direction))
        return taylor_slope(
            lambda x: cost.measure(x.reshape(a.shape), target)[0],
            *(a.ravel(), direction.ravel(), slope),
        )

    # LAPACK's rounding × cond² of raw columns ends it; along one direction in three the term of h²
    # is by chance so small that it ends half a decade sooner.
    both = (along(0.3 * a * rng.normal(size=a.shape)) for _ in range(2))
    assert_second_order(max(both, key=lambda one: one.decades), decades=3.0)


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


@pytest.mark.parametrize("names", [(), FRICTION], ids=["alone", "with friction"])
def test_costs_are_those_of_least_squares_on_all_columns(
    lib: Library, trajectories: tuple[Trajectory, ...], names: tuple[str, ...]
) -> None:
    """Oracle: the inverse over [Y_b F] of `covariance_of`, friction counted where it is fitted."""
    known, a = information(lib, friction=names), trajectories[0].coefficients
    cost = ConditionCost(lib, lib.home, 5, DURATION, information=known)
    spread = covariance_of(lib, trajectories[0], known, names, INFORMED_SAMPLES)
    size = np.maximum(np.abs(lib.base_matrix @ lib.pi0), 0.01)
    seen = unseen_torque(lib, lib.home)
    for name, value in (
        ("a", np.sqrt(np.mean(np.diag(spread) / size**2))),
        ("v", np.sqrt(np.sum(seen * spread))),
        ("d", np.exp(np.linalg.slogdet(spread)[1] / (2 * len(spread)))),
    ):
        target = CRITERIA[name].goal(lib, lib.home, known).target
        # Rounding × cond² of raw columns.
        assert value == pytest.approx(np.exp(cost.measure(a, target)[0]), rel=1e-8)


def test_scores_and_the_cost_of_the_document(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Property: cond at 80 samples as the document counts it; columns and samples of the scores."""
    known, a = information(lib), trajectories[0].coefficients
    prediction = predict(lib, trajectories[0], known)
    scores = prediction.scores
    assert [s.samples for s in scores] == [*SAMPLES, *SAMPLES]
    assert [s.columns for s in scores] == [43, 43, 64, 64]
    cost = ConditionCost(lib, lib.home, 5, DURATION)
    assert scores[0].condition == pytest.approx(np.exp(cost.by_numpy(a)[0]), rel=1e-8)
    assert np.sqrt(np.sum(prediction.torque**2)) == pytest.approx(scores[1].torque_error, rel=1e-12)


def test_friction_columns_out_and_back(lib: Library, trajectories: tuple[Trajectory, ...]) -> None:
    """Property: cosines separate columns that are odd in dq; the offset alone remains."""
    assert even_columns(FRICTION) == ("offset",)
    assert even_columns(("stribeck", "asymmetric")) == ("asymmetric",)
    a = trajectories[0].coefficients
    values = {}
    for names in ((), ("viscous", "coulomb"), ("offset",), FRICTION):
        known = information(lib, friction=names)
        cost = ConditionCost(lib, lib.home, 5, DURATION, information=known)
        values[names] = cost.measure(a, CRITERIA["v"].goal(lib, lib.home, known).target)[0]
    assert values["viscous", "coulomb"] == values[()]
    assert values["offset",] == values[FRICTION] > values[()] + 0.05


@pytest.mark.parametrize("kind", ["cosine", "fourier"])
def test_a_search_that_counts_friction_lowers_the_error_with_friction(
    lib: Library, kind: str
) -> None:
    """Property: descent from the optimum without friction, by all samples of the log."""
    basis = basis_of(kind)
    alone = information(lib, friction=())
    shape = {"duration": 5.0, "harmonics": 3, "criterion": "v", "basis": basis}
    optimum = design(lib, starts=1, information=alone, **shape).trajectory
    problem = DesignSettings(**shape, information=information(lib))
    further = replace(optimum, coefficients=Search(lib, problem).refined(optimum.coefficients))
    errors = [predict(lib, each, alone).scores[-1].torque_error for each in (optimum, further)]
    # Measured 0.87 (cosine) and 0.79 (fourier); rounding is 1e-8.
    assert errors[1] < 0.95 * errors[0]


def test_columns_of_more_than_the_speed_are_refused(lib: Library) -> None:
    """Property: one sentence with the columns that are possible."""
    for name in ("load", "dahl", "rotor", "motor_viscous"):
        with pytest.raises(IdentificationError, match=f"got {name}; choose from viscous, coulomb"):
            information(lib, friction=("viscous", name))
    with pytest.raises(RecordingError, match="no friction column 'drag'"):
        information(lib, friction=("drag",))


def test_each_criterion_is_best_by_its_measure(lib: Library) -> None:
    """Property: of four designs, each the best of two starts, each wins where it was meant to."""
    known, kinds = information(lib), ("v", "a", "d", "cond")
    scores = {}
    for name in kinds:
        result = design(lib, duration=5.0, harmonics=4, starts=2, criterion=name, information=known)
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
    result = design(lib, criterion="mixed", information=information(lib), starts=4)
    score = predict(lib, result.trajectory, information(lib), ()).scores[0]
    # Measured: 5.35, 1.93 %, 7.0 mN·m from four starts; 5.5 to 5.7, 2.3 %, 8.2 mN·m from two.
    assert result.condition < 5.5
    assert score.relative_error < 0.022
    assert score.torque_error < 0.0075


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
        (("--settings", "basis=wavelet"), "no basis 'wavelet'"),
        (("--noise", "0"), "torque noise above 0"),
        (("--noise", "1,2"), "--noise needs 7 numbers"),
        (("--settings", "log_rate=-1"), "sampling rate above 0 Hz"),
        (
            ("--settings", "friction=0.5,0.1"),
            "--friction needs names of columns with commas, or none",
        ),
        (
            ("--settings", "friction=rotor"),
            "functions of a joint's speed, got rotor; choose from viscous",
        ),
        (("--settings", "earlier_log=nowhere.csv"), "nowhere.csv"),
    ],
)
def test_bad_options(
    command: Command, lib: Library, tmp_path: Path, words: tuple[str, ...], match: str
) -> None:
    """Property: one sentence, code 2, no file."""
    ran = command("excite", "--robot", lib.folder, "--settings", "starts=1", *words)
    assert ran.code == 2
    assert match in ran.err
    assert len(ran.err.splitlines()) == 1
    assert not list(tmp_path.iterdir())
