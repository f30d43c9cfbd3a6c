"""Base parameters: the numeric rank decision against the symbolic regrouping and known counts."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime.library import Library
from symgen.chain import Chain, ChainOptions, read_chain
from symgen.chain.mechanism import mechanism_from_table
from symgen.errors import RankError
from symgen.make.request import bundled_request
from symgen.mechanics.base_parameters import BaseParameters, numeric_base
from symgen.mechanics.dynamics import sampled_regressor
from tests.conftest import TINY_URDF
from tests.linkages import planar
from tests.oracle import ask_pinocchio, pinocchio_model, random_states
from tests.regrouping_rules import regrouped_base
from tests.robots import CASES
from tests.taylor import Array


def base_of(chain: Chain) -> BaseParameters:
    return numeric_base(chain, sampled_regressor(chain))


@pytest.fixture(scope="module")
def fr3_chain() -> Chain:
    return read_chain(bundled_request("fr3").urdf)


def test_numeric_equals_symbolic_for_fr3(fr3_chain: Chain) -> None:
    """Oracle: columns and K of the sampled regressor are those of Table 3.2 with Rules 1 and 2."""
    numeric = base_of(fr3_chain)
    columns, matrix = regrouped_base(fr3_chain)
    assert numeric.columns == columns
    assert len(columns) == 43
    assert numeric.gap > 1e9
    # Least squares over base columns whose normalised condition is 5: rounding × condition × |K|.
    np.testing.assert_allclose(numeric.matrix, matrix, rtol=0, atol=1e-13)


def test_tilted_gravity_adds_two(fr3_chain: Chain) -> None:
    """Oracle: 45 base parameters (errata to Eq. 3.15), by numbers and by Rule 2."""
    options = ChainOptions(gravity=(2.0, -1.0, -9.0))
    tilted = read_chain(bundled_request("fr3").urdf, options)
    numeric = base_of(tilted)
    columns, matrix = regrouped_base(tilted)
    assert numeric.columns == columns
    assert len(columns) == 45
    assert set(columns) - set(regrouped_base(fr3_chain)[0]) == {1, 2}  # mX, mY of link 1
    np.testing.assert_allclose(numeric.matrix, matrix, rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", ["fr3", *CASES])
def test_base_predicts_what_all_parameters_predict(
    name: str, robot: Callable[[str], Library]
) -> None:
    """Property: Y_b K π = Y π for any π, and the count is the known one (36 for 6R, 43 for 7R)."""
    lib = robot(name)
    expected = 43 if name == "fr3" else CASES[name].base_parameters
    assert len(lib.base_columns) == expected
    rng = np.random.default_rng(0)
    state = random_states(lib.n_joints, 200, 1)
    for pi in (lib.pi0, rng.normal(size=lib.pi0.shape)):
        whole = lib.regressor(*state) @ pi
        reduced = lib.base_regressor(*state) @ (lib.base_matrix @ pi)
        # K is least squares over columns with a condition of a few tens at most.
        assert np.abs(whole - reduced).max() <= 1e-12 * np.abs(whole).max()
    np.testing.assert_array_equal(
        lib.base_matrix[:, list(lib.base_columns)], np.eye(len(lib.base_columns))
    )


def test_rounded_angles_hide_two_directions(shared_data: Path) -> None:
    """Oracle: the Kinova Gen3 writes π/2 with four digits: 45 as printed, 43 as meant."""
    text = (shared_data / "models" / CASES["kinova_gen3"].file).read_text()
    assert len(base_of(read_chain(text)).columns) == 45
    assert len(base_of(read_chain(text, ChainOptions(snap=1e-4))).columns) == 43


@pytest.mark.parametrize("name", ["tree", "gantry"])
def test_rank_of_trees_and_slides(name: str, robot: Callable[[str], Library]) -> None:
    """Oracle: numpy's rank of Pinocchio's regressor, for robots that no formula counts."""
    lib = robot(name)
    rows = ask_pinocchio(pinocchio_model(lib.urdf()), lib, 100).regressor
    stacked = rows.reshape(-1, rows.shape[-1])
    stacked /= np.linalg.norm(stacked, axis=0) + 1e-9
    # Far below the smallest kept singular value (0.1) and above rounding.
    assert np.linalg.matrix_rank(stacked, tol=1e-9) == len(lib.base_columns)


# --- toys: a regressor out of thin air ------------------------------------------------------


@pytest.fixture(scope="module")
def one_joint() -> Chain:
    return read_chain(TINY_URDF)


def toy(mixture: Array) -> Callable[[Array, Array, Array], Array]:
    """Regressor (N, 1, 10) of random rows times a constant 10×10 mixture of the columns."""

    def regressor(q: Array, dq: Array, ddq: Array) -> Array:
        rows = np.random.default_rng(1).normal(size=(len(q), 1, 10))
        return rows @ mixture

    return regressor


def test_full_rank_toy(one_joint: Chain) -> None:
    """Property: a full-rank regressor keeps all columns, K = 1; its gap is the machine's."""
    base = numeric_base(one_joint, toy(np.diag(np.geomspace(1, 1e6, 10))))
    assert base.columns == tuple(range(10))
    np.testing.assert_array_equal(base.matrix, np.eye(10))


def test_zero_and_noise_columns_toy(one_joint: Chain) -> None:
    """Property: silent columns, also those of pure round-off, are dropped and not normalised."""
    scale = np.ones(10)
    scale[[2, 5]] = 0.0
    scale[7] = 1e-14
    base = numeric_base(one_joint, toy(np.diag(scale)))
    assert base.columns == (0, 1, 3, 4, 6, 8, 9)
    assert not base.matrix[:, [2, 5, 7]].any()


def test_repeated_columns_toy(one_joint: Chain) -> None:
    """Property: a dependent column moves into the others with its exact coefficients."""
    mixture = np.eye(10)
    mixture[:, 8] = 2 * mixture[:, 1] - 0.25 * mixture[:, 6]
    base = numeric_base(one_joint, toy(mixture))
    expected = np.delete(np.eye(10), 8, axis=0)
    expected[[1, 6], 8] = 2, -0.25
    assert base.columns == (0, 1, 2, 3, 4, 5, 6, 7, 9)
    np.testing.assert_allclose(base.matrix, expected, rtol=0, atol=1e-13)
    assert not np.signbit(base.matrix[base.matrix == 0]).any()  # no −0 in generated files


def test_nearly_dependent_columns_toy(one_joint: Chain) -> None:
    """Property: directions that fall without a gap are kept, those farthest from the span first.

    Columns 5 to 9 are nearly parallel and differ by 3e-2 to 1e-6; column 4 repeats column 9, and
    column 3 has a direction of its own of 5e-7: the copy is the one that is left out.
    """
    mixture = np.eye(10)
    mixture[5:, 5:] = np.triu(np.ones((5, 5))) * np.array([1.0, 3e-2, 1e-3, 3e-5, 1e-6])[:, None]
    mixture[:, 4] = mixture[:, 9]
    mixture[:, 3] = mixture[:, 8]
    mixture[3, 3] = 5e-7
    base = numeric_base(one_joint, toy(mixture))
    assert len(base.columns) == 9
    (left,) = {4, 9} - set(base.columns)
    (other,) = {4, 9} & set(base.columns)
    expected = np.zeros(9)
    expected[base.columns.index(other)] = 1.0
    # Rounding over the smallest direction.
    np.testing.assert_allclose(base.matrix[:, left], expected, atol=1e-8)


@pytest.mark.parametrize(("size", "lossless"), [(0.0, True), (1e-6, False)])
def test_a_dropped_direction_above_rounding_is_a_loss(
    one_joint: Chain, size: float, lossless: bool
) -> None:
    """Property: a direction of 1e-6 behind a clear gap is dropped, and Y_b β is not Y π."""
    mixture = np.eye(10)
    mixture[:, 8] = mixture[:, 1]
    mixture[8, 8] = size
    base = numeric_base(one_joint, toy(mixture))
    assert len(base.columns) == 9
    assert base.lossless == lossless


def test_no_gap_is_an_error(one_joint: Chain) -> None:
    """Property: singular values that fall evenly to rounding decide nothing, and it says so."""
    rng = np.random.default_rng(2)
    u, v = (np.linalg.qr(rng.normal(size=(10, 10)))[0] for _ in range(2))
    mixture = u @ np.diag(np.geomspace(1, 1e-15, 10)) @ v
    with pytest.raises(RankError, match=r"expected a gap of 1000 .* --settings snap=1e-4"):
        numeric_base(one_joint, toy(mixture))


def test_states_of_a_closed_chain() -> None:
    """Property: π about the pose of assembly, and the range; open or huge states count as others.

    Column 3 repeats column 8; every tenth state has one entry that is not a number, and sizes of
    states differ by 1e8.
    """
    linkage = planar(np.random.default_rng(2), "five-bar")
    mechanism = mechanism_from_table(linkage.mechanism, "M")
    chain = read_chain(linkage.urdf, ChainOptions(mechanism=mechanism))
    bounded = replace(chain, joints=tuple(replace(j, lower=0.2, upper=0.6) for j in chain.joints))
    assert chain.loops is not None
    seen = []

    def regressor(q: Array, dq: Array, ddq: Array) -> Array:
        seen.append(q)
        assert len(q) == len(dq) == len(ddq)
        columns = 10 * len(chain.joints)
        y = np.random.default_rng(1).normal(size=(len(q), 2, columns))
        y[:, :, 3] = y[:, :, 8]
        y *= 10.0 ** np.linspace(-4, 4, len(q))[:, None, None]
        y[::10, 1, 5] = np.nan
        return y

    base = numeric_base(bounded, regressor)
    assert len(base.columns) == 10 * len(chain.joints) - 1
    expected = np.zeros(len(base.columns))
    expected[base.columns.index(8)] = 1.0
    np.testing.assert_allclose(base.matrix[:, 3], expected, atol=1e-12)
    assert base.smallest_kept > 0.1  # no state outweighs the others
    (states,) = seen
    around, within = np.split(states, 2)
    pose = np.array([chain.loops.assembly[k] for k in chain.loops.independent])
    # Thousands of uniform draws come within 1 % of the ends.
    np.testing.assert_allclose(around.min(axis=0), pose - np.pi, atol=0.06)
    np.testing.assert_allclose(around.max(axis=0), pose + np.pi, atol=0.06)
    np.testing.assert_allclose(within.min(axis=0), 0.2, atol=4e-3)
    np.testing.assert_allclose(within.max(axis=0), 0.6, atol=4e-3)


@pytest.mark.parametrize(("angle", "in_form"), [(5e-10, True), (5e-9, False)])
def test_a_turned_frame_is_geometry_above_rounding(
    fr3_chain: Chain, angle: float, in_form: bool
) -> None:
    """Property: a turn about z of 1e-9 rad is rounding of a frame; a larger one is not DH form."""
    joint = fr3_chain.joints[1]
    turn = np.array([[1.0, -angle, 0.0], [angle, 1.0, 0.0], [0.0, 0.0, 1.0]])
    rotation = tuple(map(tuple, (np.array(joint.rotation) @ turn).tolist()))
    joints = (fr3_chain.joints[0], replace(joint, rotation=rotation), *fr3_chain.joints[2:])
    turned = replace(fr3_chain, joints=joints)
    if in_form:
        assert len(regrouped_base(turned)[0]) == 43
    else:
        with pytest.raises(RankError, match=f"'{joint.name}' is not a revolute joint"):
            regrouped_base(turned)


def test_regrouping_refuses_other_geometry(robot: Callable[[str], Library]) -> None:
    """Property: chains outside modified DH form are named, not regrouped wrongly."""
    with pytest.raises(RankError, match="joint 'spin' is not a revolute joint in modified DH form"):
        regrouped_base(read_chain(robot("gantry").urdf()))
    with pytest.raises(RankError, match="is not a revolute joint in modified DH form"):
        regrouped_base(read_chain(robot("tree").urdf()))
