"""Friction coefficients: columns of rounding, possible signs, possible sizes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from runtime import Recording
from runtime.estimators.choice.friction_choice import choose_friction
from runtime.estimators.classical.least_squares import solve
from runtime.estimators.problem import MOST, Bounds, Held, notes_of, within_bounds
from runtime.estimators.regression.factor import Statistics
from runtime.identification.identified import Identification, torque_errors
from runtime.identification.result_file import warnings_of
from runtime.identification.several_logs import NamedLog
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction

LOAD = Friction(("viscous", "coulomb", "offset", "load"))
ROTOR = Friction(("viscous", "coulomb", "offset", "rotor"))


def warnings(result: Identification) -> str:
    return " ".join(warnings_of(result, *torque_errors(result)[:2]))


def test_columns_without_names_are_numbered():
    """Property: `predict` fits a log whose columns have no names."""
    flags = np.array([False, True, True, False])
    held = Held(
        flags, np.array([1.0, -2.0, -3.0, 1.0]), np.array([1.0, 0.0, 0.0, 1.0]), flags / 1.0
    )
    bounds = Bounds(np.zeros(4), np.ones(4))
    (note,) = notes_of(held, bounds, ("a", "b"), ())
    assert "column 2 of a (-2 unbounded), column 1 of b (-3 unbounded)" in note


def test_columns_that_cancel_each_other_accuse_no_joint():
    """Property: friction of 0.3 N·m whose two columns differ by 1 % has no cause in the log.

    The second coefficient has the standard deviation 0.5 / (0.01 √2000) = 1.1.
    """
    rng = np.random.default_rng(3)
    first = rng.normal(size=2000)
    rows = np.column_stack([rng.normal(size=2000), first, first + 0.01 * rng.normal(size=2000)])
    q, r = np.linalg.qr(rows)
    target = rows @ [1.0, 0.3, 0.0] + 0.5 * rng.normal(size=2000)
    rest = float(target @ target - np.sum((q.T @ target) ** 2))
    s = Statistics(r, q.T @ target, rest, 2000.0, np.eye(1), "x")

    def solve(part: Statistics):
        x = np.linalg.lstsq(part.factor, part.target, rcond=1e-12)[0]
        return x[1:], x[:1], x

    bounds = Bounds(np.zeros(2), np.full(2, 10.0))
    *_, held = within_bounds(s, bounds, solve)
    assert held.free.min() < -0.1
    (note,) = notes_of(held, bounds, ("a",), ("viscous", "coulomb"))
    assert "near 0, or hardly determined" in note
    assert "reversed" not in note


@pytest.fixture(scope="module")
def reversed_torque(clean: Recording) -> Recording:
    """The bundled log with the torque of joint 7 reversed, most of which is friction."""
    return clean.replace(tau=clean.tau * np.array([1, 1, 1, 1, 1, 1, -1.0]))


@pytest.mark.parametrize("method", ["map", "pc-ols", "ols", "wls", "lm"])
def test_a_column_of_rounding_is_left_out_and_named(lib, clean, method):
    """Oracle: joint 1 is along gravity, so |τ_g| is zero but for 1e-15 N·m of rounding."""
    result = identify_recording(clean, lib, method, friction=LOAD, certify=False)
    assert result.phi[0, 3] == 0.0
    assert np.abs(result.phi).max() < 1.0  # the plant has 0.3 N·m of Coulomb friction
    assert "left out the friction columns load of fr3_joint1" in warnings(result)


def test_a_friction_column_of_zeros_is_no_unknown(double: Library):
    """Oracle: the last joint carries no load; the solution is that without its column."""
    rng, n_base = np.random.default_rng(4), len(double.base_matrix)
    rows = rng.normal(size=(500, n_base + 2))
    rows[:, -1] = 0.0
    q, r = np.linalg.qr(rows)
    target = rows.sum(axis=1) + 0.1 * rng.normal(size=500)
    rest = float(target @ target - np.sum((q.T @ target) ** 2))
    s = Statistics(r, q.T @ target, rest, 500.0, np.eye(n_base), "x")
    solution = solve(s, double, ("load",))
    expected = np.linalg.lstsq(rows[:, :-1], target, rcond=None)[0]
    # Rounding of two solutions with a condition number below 2.
    np.testing.assert_allclose(solution.beta, expected[:-1], rtol=0, atol=1e-13)
    np.testing.assert_allclose(solution.phi, [[expected[-1]], [0.0]], rtol=0, atol=1e-13)


def test_a_column_of_rounding_is_no_unknown_of_the_choice(lib, clean):
    """Property: the load of joint 1 is not among the parameters that the data determine."""
    choice = choose_friction(clean, lib, names=("coulomb", "load"), coulomb_speed=0.02)
    plain, load = choice.candidates
    assert load.parameters == plain.parameters + 6


@pytest.mark.parametrize("method", ["map", "pc-ols", "ols", "wls"])
def test_several_logs_take_offset_and_rotor(lib, clean, method):
    """Oracle: the plant's friction, in two halves of one log with an offset each."""
    halves = [
        NamedLog(name, clean.take(rows, name))
        for name, rows in (("a", slice(0, 500)), ("b", slice(500, 1001)))
    ]
    result = identify_recording(halves, lib, method, friction=ROTOR)
    # 0.2 N·m·s/rad and 0.3 N·m; the friction models differ by ε and 0.05 N·m of noise.
    assert result.usual_phi[:, 0] == pytest.approx(0.2, abs=0.05)
    assert result.usual_phi[:, 1] == pytest.approx(0.3, abs=0.05)
    assert result.usual_phi.shape == (7, 4)


@pytest.mark.parametrize("method", ["map", "pc-ols"])
def test_friction_that_drives_a_joint_is_bounded_and_reported(lib, reversed_torque, method):
    """Property: no coefficient below 0, and the unbounded value with its cause."""
    result = identify_recording(reversed_torque, lib, method, friction=ROTOR, certify=False)
    assert result.phi[:, [0, 1, 3]].min() >= 0.0
    assert result.phi[6, [0, 1]].tolist() == [0.0, 0.0]
    said = warnings(result)
    assert "negative coefficients were bounded by 0" in said
    assert "coulomb of fr3_joint7 (-" in said
    assert "torque is reversed" in said


def test_methods_without_bounds_report_negative_friction(lib, reversed_torque, clean):
    """Property: named with its value where it counts, and not on a correct log."""
    wrong = identify_recording(reversed_torque, lib, "ols", friction=ROTOR, certify=False)
    assert "coulomb of fr3_joint7 -" in warnings(wrong)
    assert "map and pc-ols bound them by 0" in warnings(wrong)
    right = identify_recording(clean, lib, "ols", friction=ROTOR, certify=False)
    assert "negative" not in warnings(right)


def test_a_correct_log_is_not_suspected(lib, clean):
    """Property: negative values within the error of the fit have no cause in the log."""
    result = identify_recording(clean, lib, friction=ROTOR, certify=False)
    assert "torque is reversed" not in warnings(result)


def test_a_joint_at_rest_gets_no_huge_friction(lib: Library, clean: Recording):
    """Property: with speeds of 1e-3 rad/s by noise, friction stays at a size of the torque."""
    rng = np.random.default_rng(0)
    dq = clean.dq.copy()
    dq[:, 6] = 1e-3 * rng.normal(size=len(dq))
    q = clean.q.copy()
    q[:, 6] = q[0, 6]
    log = clean.replace(q=q, dq=dq)
    for method in ("map", "pc-ols"):
        result = identify_recording(log, lib, method, friction=LOAD, certify=False)
        columns = np.sqrt(np.mean(result.train.columns**2, axis=0))
        torque = np.sqrt(np.mean(result.train.tau**2, axis=0))
        size = np.abs(result.phi) * columns / torque[:, None]
        assert size.max() <= MOST * (1 + 1e-9)  # the quotient is rounded


def _statistics(rng: np.random.Generator, n_base: int, n_phi: int) -> Statistics:
    rows = rng.normal(size=(60, n_base + n_phi)) @ rng.normal(size=(n_base + n_phi,) * 2)
    q, r = np.linalg.qr(rows)
    target = rng.normal(size=60)
    rest = float(target @ target - np.sum((q.T @ target) ** 2))
    return Statistics(r, q.T @ target, rest, 60.0, np.eye(n_base), "x")


def test_the_active_set_is_the_optimum_within_bounds():
    """Oracle: SciPy's bounded least squares on 40 dense problems with 4 to 12 coefficients."""
    rng = np.random.default_rng(1)
    active = 0
    for _ in range(40):
        n_base, n_phi = 3, int(rng.integers(4, 13))
        s = _statistics(rng, n_base, n_phi)
        free = np.linalg.lstsq(s.factor, s.target)[0][n_base:]
        half = np.abs(free) * rng.uniform(0.2, 3.0, n_phi)
        bounds = Bounds(np.where(rng.uniform(size=n_phi) < 0.5, 0.0, -half), half)

        def solve(part: Statistics):
            x = np.linalg.lstsq(part.factor, part.target, rcond=1e-12)[0]
            return x[3:], x[:3], x

        phi, x, held = within_bounds(s, bounds, solve)
        infinite = np.full(n_base, np.inf)
        box = (np.r_[-infinite, bounds.lower], np.r_[infinite, bounds.upper])
        expected = lsq_linear(s.factor, s.target, box, method="bvls", tol=1e-14).x
        # Condition numbers up to 1e4 and the tolerance of BVLS.
        np.testing.assert_allclose(phi, expected[n_base:], atol=1e-7 * (1 + np.abs(free).max()))
        np.testing.assert_allclose(x[:n_base], expected[:n_base], atol=1e-7 * (1 + np.abs(x).max()))
        active += int(held.flags.sum())
    assert active > 100


def test_the_gap_of_bounded_friction_is_that_of_the_bounded_optimum(lib, reversed_torque):
    """Property: the optimum with bounds is no smaller than without, and the gap is not negative."""
    result = identify_recording(reversed_torque, lib, "pc-ols", friction=ROTOR)
    loose = identify_recording(reversed_torque, lib, "lm", friction=ROTOR)
    assert result.optimum > loose.optimum
    assert -1e-6 < result.gap < 2e-3  # pc-ols stops at 1e-3 above the optimum


@pytest.mark.parametrize("repeated", [False, True])
def test_evidence_is_what_a_column_alone_explains(repeated: bool):
    """Oracle: least squares of each held column on all others; a repeated one explains nothing."""
    s = _statistics(np.random.default_rng(2), 3, 6)
    if repeated:
        s = replace(s, factor=np.hstack([s.factor[:, :-1], s.factor[:, -2:-1]]))
    first = np.linalg.lstsq(s.factor, s.target)[0]
    bounds = Bounds(np.abs(first[3:]) / 2, np.abs(first[3:]))  # holds all negative coefficients

    def solve(part: Statistics):
        x = np.linalg.lstsq(part.factor, part.target, rcond=1e-12)[0]
        return x[3:], x[:3], x

    _, _, held = within_bounds(s, bounds, solve)
    assert held.flags.sum() >= 2
    left = s.factor @ first - s.target
    for k in np.flatnonzero(held.flags) + 3:
        others = np.delete(s.factor, k, axis=1)
        alone = s.factor[:, k] - others @ np.linalg.lstsq(others, s.factor[:, k])[0]
        size = np.abs(first[k]) * np.linalg.norm(alone) / np.sqrt(left @ left + s.rest)
        # Rounding × condition numbers up to 1e4.
        np.testing.assert_allclose(held.evidence[k - 3], size, rtol=1e-10, atol=1e-10)
