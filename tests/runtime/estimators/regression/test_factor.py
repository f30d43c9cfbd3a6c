"""runtime.estimators.regression: the compiled one-pass factor against NumPy's QR of all rows."""

import ctypes
import dataclasses
import shutil
import subprocess

import numpy as np
import pytest

from runtime.common.compiler import find_compiler, machine
from runtime.errors import IdentificationError
from runtime.estimators.regression import factor
from runtime.estimators.regression.factor import (
    Statistics,
    compress,
    compress_all,
    reference_triangle,
)
from runtime.estimators.regression.samples import Samples
from runtime.library import Library, load
from tests.robots import levels_here

ROBOTS = ["fr3", "tree", "gantry", "tiny", "double"]


def drawn(lib: Library, count: int, k: int = 0, seed: int = 0, size: float = 1.0) -> Samples:
    """Random motion, friction columns and torque with noise."""
    rng = np.random.default_rng(seed)
    n = lib.n_joints
    q = lib.home + size * rng.normal(size=(count, n))
    dq, ddq = size * rng.normal(size=(2, count, n))
    columns = rng.normal(size=(count, n, k))
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + columns.sum(axis=2)
    return Samples(q, dq, ddq, tau + 0.01 * rng.normal(size=tau.shape), columns)


def taken(s: Samples, part: slice) -> Samples:
    return Samples(*(a[part] for a in (s.q, s.dq, s.ddq, s.tau, s.columns)))


def explicit(
    lib: Library, s: Samples, weights: np.ndarray, sample_weights: np.ndarray | None = None
):
    """All weighted rows [Y_b F τ]."""
    count, n, k = s.columns.shape
    spread = np.zeros((count, n, n * k))
    for j in range(n):
        spread[:, j, j * k : (j + 1) * k] = s.columns[:, j]
    base = lib.base_regressor(s.q, s.dq, s.ddq)
    rows = np.concatenate([base, spread, s.tau[:, :, None]], axis=2)
    rows = rows * np.sqrt(weights)[:, None]
    if sample_weights is not None:
        rows = rows * np.sqrt(sample_weights)[:, None, None]
    return rows.reshape(count * n, -1)


def gram(statistics: Statistics) -> np.ndarray:
    whole = np.column_stack([statistics.factor, statistics.target])
    square = whole.T @ whole
    square[-1, -1] += statistics.rest
    return square


def assert_same(statistics: Statistics, rows: np.ndarray) -> None:
    """RᵀR = AᵀA entry by entry, relative to the lengths of the two columns."""
    expected = rows.T @ rows
    lengths = np.sqrt(np.diag(expected))
    scale = np.outer(lengths, lengths)
    # Rounding of sums of up to 1e4 terms and of as many reflections; squares that underflow.
    assert (np.abs(gram(statistics) - expected) <= 1e-13 * scale + 1e-140).all()


@pytest.mark.parametrize("k", [0, 1, 2, 3, 6])
@pytest.mark.parametrize("name", ROBOTS)
def test_factor_equals_that_of_all_rows(any_robot, name, k):
    """Oracle: explicit rows; every level, N below p, no multiple of 8 or 64, none at all."""
    lib = any_robot(name)
    weights = np.random.default_rng(1).uniform(0.5, 2.0, lib.n_joints)
    for level in levels_here(lib):
        one_level = load(lib.folder, level)
        assert one_level.compiled_statistics is not None
        for count in (1, 3, 8, 61, 64, 203):
            s = drawn(lib, count, k)
            statistics = compress(one_level, s, weights)
            assert_same(statistics, explicit(lib, s, weights))
            triangle = statistics.triangle()
            assert np.array_equal(triangle, np.triu(triangle))
            assert (np.diag(triangle) >= 0).all()
            assert statistics.n_samples == count
    none = compress(lib, drawn(lib, 0, k), weights)
    assert not none.factor.any()
    assert none.n_samples == none.rest == 0


@pytest.mark.parametrize("name", ROBOTS)
def test_equals_the_reference(any_robot, name):
    """Oracle: NumPy's QR, whose triangle with a diagonal ≥ 0 is the same one."""
    lib = any_robot(name)
    s, weights = drawn(lib, 300, 2), np.linspace(1, 2, lib.n_joints)
    sample_weights = np.random.default_rng(2).uniform(0, 1, 300)
    wanted = reference_triangle(lib, s, weights, sample_weights)
    got = compress(lib, s, weights, sample_weights).triangle()
    # Rounding times the condition number of the columns, at most 1e4 here.
    assert np.abs(got - wanted).max() <= 1e-11 * np.abs(wanted).max()
    lib.compiled_statistics = None  # without the compiled function the reference answers
    again = compress(lib, s, weights, sample_weights).triangle()
    lib.__init__(lib.folder)
    assert np.abs(again - wanted).max() <= 1e-15 * np.abs(wanted).max()


def test_ill_conditioned_data_keep_their_digits(lib: Library) -> None:
    """Oracle: the truth; as near to it as NumPy on all rows, where normal equations fail."""
    s = drawn(lib, 4000, size=2e-4)
    beta = lib.base_matrix @ lib.pi0
    s = dataclasses.replace(s, tau=lib.base_regressor(s.q, s.dq, s.ddq) @ beta)
    rows = explicit(lib, s, np.ones(7))
    lengths = np.linalg.norm(rows[:, :-1], axis=0)
    matrix = rows[:, :-1] / lengths
    assert np.linalg.cond(matrix) > 1e7
    truth = beta * lengths

    def error(x: np.ndarray) -> float:
        return float(np.linalg.norm(x - truth) / np.linalg.norm(truth))

    best = error(np.linalg.lstsq(matrix, rows[:, -1], rcond=None)[0])
    normal = error(np.linalg.solve(matrix.T @ matrix, matrix.T @ rows[:, -1]))
    for level in levels_here(lib):
        statistics = compress(load(lib.folder, level), s, np.ones(7))
        ours = error(np.linalg.solve(statistics.factor / lengths, statistics.target))
        # Both errors are rounding times the condition number; their ratio is luck.
        assert ours <= 30 * best + 1e-12
        assert ours <= 1e-3 * normal


def test_weights_of_samples_repeat_them(lib: Library) -> None:
    """Property: a weight of 2 counts a sample twice, a weight of 0 leaves it out."""
    s, weights = drawn(lib, 100, 1), np.ones(7)
    sample_weights = np.tile([2.0, 0.0, 1.0, 1.0], 25)
    rows = np.repeat(np.arange(100), sample_weights.astype(int))
    repeated = Samples(*(a[rows] for a in (s.q, s.dq, s.ddq, s.tau, s.columns)))
    statistics = compress(lib, s, weights, sample_weights)
    assert_same(statistics, explicit(lib, repeated, weights))
    assert statistics.n_samples == len(rows)


def test_merged_parts_are_the_whole(lib: Library) -> None:
    """Property: three logs, one of fewer rows than columns, add up in any grouping."""
    s, weights = drawn(lib, 500, 2), np.linspace(0.5, 1.5, 7)
    parts = [
        compress(lib, taken(s, slice(*ends)), weights) for ends in ((0, 3), (3, 200), (200, 500))
    ]
    rows = explicit(lib, s, weights)
    for merged in (parts[0].merged(*parts[1:]), parts[2].merged(parts[1]).merged(parts[0])):
        assert_same(merged, rows)
        assert merged.n_samples == 500


def test_forgetting_scales_the_past(lib: Library) -> None:
    """Property: as if the old samples had been weighted."""
    s, weights = drawn(lib, 200, 1), np.ones(7)
    old, new = (compress(lib, taken(s, part), weights) for part in (slice(100), slice(100, None)))
    sample_weights = np.repeat([0.25, 1.0], 100)
    merged = old.scaled(0.25).merged(new)
    assert_same(merged, explicit(lib, s, weights, sample_weights))
    assert merged.n_samples == 125
    for wrong in (0.0, 1.5, np.nan):
        with pytest.raises(IdentificationError, match="forgetting factor above 0 and at most 1"):
            old.scaled(wrong)


def test_threads_change_nothing(lib: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: bit by bit the same for any number of threads; blocks are those of all samples."""
    monkeypatch.setattr(factor, "BLOCK", 64)
    s, weights = drawn(lib, 1000, 1), np.ones(7)
    one, two, five = (compress(lib, s, weights, threads=t).triangle() for t in (1, 2, 5))
    assert np.array_equal(one, two)
    assert np.array_equal(one, five)
    assert_same(compress(lib, s, weights), explicit(lib, s, weights))


def test_what_is_no_data_is_refused(lib: Library) -> None:
    """Property: NaN and infinity pass through the C to the door; weights and robots are checked."""
    for level in levels_here(lib):
        one_level = load(lib.folder, level)
        for bad in (np.nan, np.inf):
            for key in ("q", "ddq", "tau", "columns"):
                s = drawn(lib, 70, 1)
                getattr(s, key)[37, 6] = bad
                with pytest.raises(IdentificationError, match="hold NaN, infinite"):
                    compress(one_level, s, np.ones(7))
    s = drawn(lib, 20)
    with pytest.raises(IdentificationError, match=r"expected weights of shape \(7,\)"):
        compress(lib, s, np.ones(6))
    with pytest.raises(IdentificationError, match=r"expected sample_weights of shape \(20,\)"):
        compress(lib, s, np.ones(7), -np.ones(20))
    with pytest.raises(IdentificationError, match="of one robot with equally many friction"):
        compress(lib, s, np.ones(7)).merged(compress(lib, drawn(lib, 20, 1), np.ones(7)))


def test_silent_and_tiny_columns_do_no_harm(lib: Library) -> None:
    """Property: columns of zeros, or of squares that underflow, leave the others as they are."""
    s = drawn(lib, 200, 3)
    s.columns[:, :, 1] = 0.0
    s.columns[:, :, 2] *= 1e-158
    statistics = compress(lib, s, np.ones(7))
    assert_same(statistics, explicit(lib, s, np.ones(7)))
    lengths = statistics.unit_columns()[1][statistics.n_base :].reshape(7, 3)
    assert (lengths[:, 1] == 1.0).all()


def test_columns_whose_cubes_underflow_count_as_silent(lib: Library) -> None:
    """Property: a Stribeck peak that no sample reaches is next to zero; it was NaN once."""
    s = drawn(lib, 200, 3)
    s.columns[:, :, 2] *= 1e-120
    stored = compress(lib, s, np.ones(7)).triangle()
    s.columns[:, :, 2] = 0.0
    np.testing.assert_allclose(stored, compress(lib, s, np.ones(7)).triangle(), rtol=0, atol=1e-100)


@pytest.mark.parametrize("name", ROBOTS)
def test_real_time_update_equals_the_batch(any_robot, name):
    """Oracle: the batch, with weights that are powers of the forgetting factor."""
    lib = any_robot(name)
    s, weights = drawn(lib, 80), np.linspace(1, 2, lib.n_joints)
    dll = ctypes.CDLL(str(lib.folder / f"lib{lib.name}.so"))
    update = dll[f"{lib.name}_statistics_update"]
    pointer = ctypes.c_void_p
    update.argtypes = (pointer, ctypes.c_double, *(pointer,) * 5)
    size = len(lib.base_columns) + 1
    factor = np.zeros((size, size))
    for row in zip(s.q, s.dq, s.ddq, s.tau, strict=True):
        update(factor.ctypes.data, 0.97, *(a.ctypes.data for a in (*row, weights)))
    sample_weights = 0.97 ** np.arange(79, -1, -1.0)
    wanted = compress(lib, s, weights, sample_weights).triangle()
    # 80 steps of rounding, times the condition number.
    assert np.abs(factor - wanted).max() <= 1e-10 * np.abs(wanted).max()
    assert (np.diag(factor) >= 0).all()
    assert np.array_equal(factor, np.triu(factor))


@pytest.mark.parametrize("source", ["statistics.c", "update.c"])
@pytest.mark.parametrize("name", ROBOTS)
def test_sources_are_clean_under_strict_warnings(any_robot, tmp_path, name, source):
    """Property: the compiler has nothing to say, conversions between signs and widths included."""
    for file in any_robot(name).folder.glob("*.[ch]"):
        shutil.copy(file, tmp_path)
    strict = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-Wconversion"]
    level = "v2" if machine() == "x86_64" else "neon"
    run = subprocess.run(
        [*find_compiler(), *strict, f"-DLEVEL={level}", "-DW=2", "-c", source, "-o", "x.o"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr[:2000]


@pytest.mark.parametrize("count", [1, 2, factor.TOGETHER, factor.TOGETHER + 2])
def test_pieces_are_compressed_as_one_log(any_robot, count: int) -> None:
    """Property: Gram matrix, right-hand side and power of all pieces, however many."""
    lib = any_robot("tiny")
    whole, weights = drawn(lib, 7 * count), np.array([2.0])
    pieces = (taken(whole, slice(7 * k, 7 * k + 7)) for k in range(count))
    made, expected = compress_all(lib, pieces, weights), compress(lib, whole, weights)
    assert made.n_samples == 7 * count
    # Rounding of sums of the same rows in another order.
    np.testing.assert_allclose(made.factor.T @ made.factor, expected.factor.T @ expected.factor)
    np.testing.assert_allclose(made.factor.T @ made.target, expected.factor.T @ expected.target)
    assert made.rest == pytest.approx(expected.rest, rel=1e-9)
