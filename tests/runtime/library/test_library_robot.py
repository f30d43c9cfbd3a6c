"""The compiled library: the facts of its robot, and bodies that can and cannot exist."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import NotRealisableError, ShapeError
from runtime.library import Library, load, to_pinocchio_order
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest, RobotConfig
from tests.robots import ONE_LEVEL

PRINTED_LINK_7 = [1.2543, 0.0057, 0.0108, -0.0203, 9e-4, 8e-4, 3e-4, -1e-4, 2e-4, 4e-4]
"""Table B.4: rounding made a body that cannot exist."""


def test_facts_of_fr3(fr3: Library) -> None:
    """Oracle: the manufacturer's limits (errata to Tables B.1, B.2) and the default pose."""
    limits = fr3.limits()
    assert limits["lower"][0] == -2.7437
    assert limits["upper"][6] == 3.0159
    assert limits["effort"].tolist() == [87.0] * 4 + [12.0] * 3
    assert limits["velocity"].tolist() == [2.62] * 4 + [5.26, 4.18, 5.26]
    assert limits["acceleration"].tolist() == [10.0] * 7
    np.testing.assert_allclose(
        fr3.home, np.pi * np.array([-0.5, -0.25, 0, -0.75, 0, 0.5, 0.25]), rtol=1e-15, atol=0
    )
    assert fr3.base_matrix.shape == (43, 70)
    assert fr3.gravity.tolist() == [0.0, 0.0, -9.81]


def test_absent_limits_are_infinite(robot: Callable[[str], Library]) -> None:
    """Property: a continuous joint without limits has none; nothing is invented."""
    limits = robot("tree").limits()
    assert limits["lower"].tolist() == [-2, -1, -np.inf, -2]
    assert limits["velocity"].tolist() == [2, 3, np.inf, 3]
    assert np.isinf(limits["jerk"]).all()


def test_robot_configuration_arrives(tmp_path: Path, tiny_request: BuildRequest) -> None:
    """Property: home, acceleration and jerk of the TOML come out of the library."""
    config = RobotConfig(home=(0.25,), acceleration=(5.0,), jerk=(100.0,))
    request = BuildRequest("tiny", tiny_request.urdf, config=config)
    lib = load(build(request, tmp_path, levels=ONE_LEVEL).folder)
    limits = lib.limits()
    assert (lib.home[0], limits["acceleration"][0], limits["jerk"][0]) == (0.25, 5.0, 100.0)


def test_pinocchio_order() -> None:
    """Oracle: pinocchio's documented order of a body's ten parameters."""
    names = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 9])  # m mX mY mZ XX YY ZZ XY XZ YZ
    assert to_pinocchio_order(names).tolist() == [0, 1, 2, 3, 4, 7, 5, 8, 9, 6]
    two = np.arange(40.0).reshape(2, 20)
    assert to_pinocchio_order(two)[1, 10:].tolist() == [30, 31, 32, 33, 34, 37, 35, 38, 39, 36]
    for wrong in (1.0, np.zeros(7)):
        with pytest.raises(ShapeError, match="10 entries per link"):
            to_pinocchio_order(wrong)


def test_lam_and_pi_of_the_robot(fr3: Library) -> None:
    """Property: λ0 is the λ of π0, in batches as alone."""
    np.testing.assert_allclose(fr3.lam_from_pi(fr3.pi0), fr3.lam0, rtol=0, atol=1e-13)
    pi = fr3.pi_from_lam(fr3.lam0)
    # a² of the thin link 7 is a difference of its moments: rounding × trace.
    np.testing.assert_allclose(pi, fr3.pi0, rtol=0, atol=1e-15)
    rng = np.random.default_rng(0)
    lams = fr3.lam0 + rng.normal(0, 0.1, (4, 70))
    pis = fr3.pi_from_lam(lams)
    for k in range(4):
        np.testing.assert_array_equal(pis[k], fr3.pi_from_lam(lams[k]))
    assert fr3.pi_jacobian(lams).shape == (4, 7, 10, 10)
    assert fr3.inertia_matrix(lams).shape == (4, 7, 6, 6)
    assert fr3.pseudo_inertia(pis).shape == (4, 7, 4, 4)
    np.testing.assert_array_equal(fr3.pseudo_inertia(pis)[2], fr3.pseudo_inertia(pis[2]))


def test_impossible_links_are_named(fr3: Library) -> None:
    """Property: the error names every bad link and the way out, and the way out works."""
    pi = fr3.pi0.copy()
    pi[60:] = PRINTED_LINK_7
    pi[20] = -1.0
    with pytest.raises(
        NotRealisableError, match=r"pi of fr3_link3, fr3_link7 is not physically consistent"
    ):
        fr3.lam_from_pi(pi)
    pi[20] = fr3.pi0[20]
    with pytest.raises(NotRealisableError, match=r"pi of fr3_link7 .*nearest_realisable\(pi\)"):
        fr3.lam_from_pi(np.stack([fr3.pi0, pi]))
    repaired = fr3.nearest_realisable(pi)
    assert np.isfinite(fr3.lam_from_pi(repaired)).all()
    assert (fr3.relative_eigenvalues(repaired) > 0).all()
    assert fr3.relative_eigenvalues(pi)[6] < 0
    # The other links stay what they were, to rounding; link 7 keeps its mass and centre of mass.
    np.testing.assert_allclose(repaired[:60], pi[:60], rtol=0, atol=1e-15)
    np.testing.assert_allclose(repaired[60:64], pi[60:64], rtol=1e-15)


def test_missing_numbers_are_no_body(fr3: Library) -> None:
    """Property: NaN in π is refused by name too."""
    pi = fr3.pi0.copy()
    pi[14] = np.nan
    with pytest.raises(NotRealisableError, match="pi of fr3_link2"):
        fr3.lam_from_pi(pi)


def test_relative_eigenvalues(fr3: Library) -> None:
    """Oracle: numpy's smallest eigenvalue of P over its trace; a zero π is 0, NaN stays NaN."""
    p = fr3.pseudo_inertia(fr3.pi0)
    expected = [np.linalg.eigvalsh(block)[0] / np.trace(block) for block in p]
    np.testing.assert_allclose(fr3.relative_eigenvalues(fr3.pi0), expected, rtol=1e-12)
    assert fr3.relative_eigenvalues(np.zeros(70)).tolist() == [0.0] * 7
    assert np.isnan(fr3.relative_eigenvalues(np.full(70, np.nan))).all()
