"""The compiled library: how arrays go through, and on how many threads."""

from collections.abc import Callable
from concurrent import futures

import numpy as np
import pytest

from runtime.errors import LibraryError, ShapeError
from runtime.library import Library, load
from runtime.library.binding import PART, zeros
from tests.oracle import random_states


def motion_calls(lib: Library) -> dict[str, Callable[..., np.ndarray]]:
    """Every kernel of (q, dq, ddq), by name."""
    return {
        "inverse_dynamics": lambda q, dq, ddq: lib.inverse_dynamics(q, dq, ddq, lib.pi0),
        "torque": lambda q, dq, ddq: lib.torque(q, dq, ddq, lib.lam0),
        "torque_jacobian": lambda q, dq, ddq: lib.torque_jacobian(q, dq, ddq, lib.lam0),
        "regressor": lib.regressor,
        "base_regressor": lib.base_regressor,
        "mass_matrix": lambda q, dq, ddq: lib.mass_matrix(q, lib.pi0),
        "bias_forces": lambda q, dq, ddq: lib.bias_forces(q, dq, lib.pi0),
        "forward_dynamics": lambda q, dq, ddq: lib.forward_dynamics(q, dq, ddq, lib.pi0),
        "end_effector": lambda q, dq, ddq: lib.end_effector(q),
        "link_poses": lambda q, dq, ddq: lib.link_poses(q),
    }


def test_one_sample_equals_its_row_in_a_batch(fr3: Library) -> None:
    """Property: bit by bit, for every kernel; a batch of one keeps its axis."""
    states = random_states(7, 5, 0)
    for name, call in motion_calls(fr3).items():
        batch = call(*states)
        assert batch.shape[0] == 5, name
        for k in range(5):
            one = call(*(part[k] for part in states))
            assert one.shape == batch.shape[1:], name
            np.testing.assert_array_equal(one, batch[k], err_msg=name)
            row = call(*(part[k : k + 1] for part in states))
            np.testing.assert_array_equal(row, batch[k : k + 1], err_msg=name)


def test_empty_batch(fr3: Library) -> None:
    """Property: no samples in, no samples out, for every kernel; sums are zero."""
    empty = np.empty((0, 7))
    for name, call in motion_calls(fr3).items():
        assert call(empty, empty, empty).shape[0] == 0, name
    loss, gradient, residual = fr3.loss_gradient(empty, empty, empty, empty, np.ones(7), fr3.pi0)
    assert (loss, gradient.tolist(), residual.shape) == (0.0, [0.0] * 70, (0, 7))
    assert fr3.pi_from_lam(np.empty((0, 70))).shape == (0, 70)
    assert fr3.lam_from_pi(np.empty((0, 70))).shape == (0, 70)


def test_parameters_once_or_per_sample(fr3: Library) -> None:
    """Property: π given once serves all samples; given per sample, each has its own."""
    q, dq, ddq = random_states(7, 4, 1)
    scales = np.array([1.0, 2.0, 0.5, 4.0])
    shared = fr3.inverse_dynamics(q, dq, ddq, fr3.pi0)
    own = fr3.inverse_dynamics(q, dq, ddq, scales[:, None] * fr3.pi0)
    # Powers of two scale without rounding, and τ is linear in π.
    np.testing.assert_array_equal(own, scales[:, None] * shared)


def test_one_state_for_many_parameters(fr3: Library) -> None:
    """Property: any argument may be the shared one."""
    q, dq, ddq = (part[0] for part in random_states(7, 1, 1))
    pi = np.stack([fr3.pi0, 2 * fr3.pi0])
    tau = fr3.inverse_dynamics(q, dq, ddq, pi)
    np.testing.assert_array_equal(tau[1], 2 * tau[0])


def test_memory_order_and_type_do_not_matter(fr3: Library) -> None:
    """Property: Fortran order, strides, lists, integers and float32 are read as their values."""
    q, dq, ddq = random_states(7, 6, 2)
    expected = fr3.inverse_dynamics(q, dq, ddq, fr3.pi0)
    wide = np.zeros((6, 14))
    wide[:, ::2] = q
    for same in (np.asfortranarray(q), wide[:, ::2], q.tolist(), np.flip(np.flip(q, 0).copy(), 0)):
        np.testing.assert_array_equal(fr3.inverse_dynamics(same, dq, ddq, fr3.pi0), expected)
    ones = np.ones(7, dtype=int)
    np.testing.assert_array_equal(
        fr3.inverse_dynamics(ones, ones, ones, fr3.pi0),
        fr3.inverse_dynamics(ones.astype(np.float32), 1.0 * ones, 1.0 * ones, fr3.pi0),
    )


def test_inputs_are_not_written(fr3: Library) -> None:
    """Property: read-only inputs work and stay as they are."""
    q, dq, ddq = random_states(7, 3, 3)
    for part in (q, dq, ddq):
        part.flags.writeable = False
    copy = q.copy()
    for call in motion_calls(fr3).values():
        call(q, dq, ddq)
    np.testing.assert_array_equal(q, copy)


def test_nan_propagates(fr3: Library) -> None:
    """Property: NaN in one sample reaches its own results and no other sample's."""
    q, dq, ddq = random_states(7, 3, 4)
    clean = {name: call(q, dq, ddq) for name, call in motion_calls(fr3).items()}
    q[1, 3] = np.nan
    for name, call in motion_calls(fr3).items():
        out = call(q, dq, ddq)
        assert np.isnan(out[1]).any(), name
        np.testing.assert_array_equal(out[[0, 2]], clean[name][[0, 2]], err_msg=name)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros(6), np.zeros(7), np.zeros(7)), r"q .* \(N, 7\) or \(7,\) \[rad\], got \(6,\)"),
        ((np.zeros((7, 3)), np.zeros((7, 3)), np.zeros((7, 3))), r"q needs .* got \(7, 3\)"),
        ((np.zeros((2, 7)), np.zeros((3, 7)), np.zeros(7)), r"got q \(2, 7\), dq \(3, 7\)"),
        ((np.zeros((1, 2, 7)), np.zeros(7), np.zeros(7)), r"got \(1, 2, 7\)"),
        ((0.0, np.zeros(7), np.zeros(7)), r"q needs the shape"),
        ((np.zeros(7), ["a"] * 7, np.zeros(7)), r"dq needs real numbers, got \['a'"),
        ((np.zeros(7), np.zeros(7), np.zeros(7, dtype=complex)), r"ddq needs real numbers"),
        ((np.zeros(7), None, np.zeros(7)), r"dq needs"),
        (([[0.0] * 7, [0.0] * 6], np.zeros(7), np.zeros(7)), r"q needs real numbers"),
    ],
)  # fmt: skip
def test_wrong_shapes_and_types(fr3: Library, arguments: tuple, message: str) -> None:
    """Property: the message names kernel, argument, expected shape with unit, and what came."""
    with pytest.raises(ShapeError, match=f"regressor.*{message}"):
        fr3.regressor(*arguments)


def test_wrong_parameter_lengths(fr3: Library) -> None:
    """Property: π and λ of the wrong number of links are refused by every map of bodies."""
    maps = (
        fr3.pi_from_lam,
        fr3.pi_jacobian,
        fr3.lam_from_pi,
        fr3.nearest_realisable,
        fr3.inertia_matrix,
        fr3.pseudo_inertia,
    )
    for method in maps:
        for wrong in (np.zeros(10), np.zeros(69), np.zeros((7, 10)), np.zeros((2, 7, 10)), 1.0):
            with pytest.raises(ShapeError, match=r"needs the shape \(70,\) or \(N, 70\)"):
                method(wrong)


def test_results_do_not_depend_on_the_number_of_threads(fr3):
    """Property: pieces of fixed length, so 1, 2 and 5 threads give the same bits, sums included."""
    rng = np.random.default_rng(4)
    n = 2 * PART + 137
    q, dq, ddq, tau = rng.normal(size=(4, n, 7))
    weight = np.linspace(0.5, 2, 7)
    answers = []
    for threads in (1, 2, 5):
        lib = load(fr3.folder, threads=threads)
        answers.append(
            (
                lib.inverse_dynamics(q, dq, ddq, lib.pi0),
                *lib.loss_gradient(q, dq, ddq, tau, weight, lib.pi0),
            )
        )
    for other in answers[1:]:
        for ours, theirs in zip(answers[0], other, strict=True):
            np.testing.assert_array_equal(ours, theirs)
    # Oracle: the sum over samples in NumPy; 8000 terms of both signs cost a few digits.
    residual = fr3.inverse_dynamics(q, dq, ddq, fr3.pi0) - tau
    assert answers[0][1] == pytest.approx(np.sum(residual**2 @ weight) / 2, rel=1e-12)


def test_threads_are_used_where_they_pay(fr3, monkeypatch):
    """Property: a short batch stays in its thread, a long one is spread over all cores."""
    seen = []
    monkeypatch.setattr("runtime.library.binding.cores", lambda: 3)
    real = futures.ThreadPoolExecutor

    def watched(workers):
        seen.append(workers)
        return real(workers)

    monkeypatch.setattr("runtime.library.binding.ThreadPoolExecutor", watched)
    lib = load(fr3.folder)
    lib.end_effector(np.zeros((5000, 7)))
    assert seen == []
    lib.regressor(*np.zeros((3, 12 * PART, 7)))
    assert seen == [3]


def test_threads_are_at_least_one(fr3):
    """Property: zero threads are refused in a sentence."""
    with pytest.raises(LibraryError, match="threads must be at least 1, got 0"):
        load(fr3.folder, threads=0)


@pytest.mark.parametrize("shape", [(1,), (7,), (3, 16), (2, 5, 3)])
def test_zeros_begin_with_a_cache_line(shape: tuple[int, ...]) -> None:
    """Property: any shape, one piece, its first number at a multiple of 64 bytes."""
    kept = [zeros(*shape) for _ in range(20)]  # the addresses of the allocator differ
    for array in kept:
        assert array.shape == shape
        assert array.ctypes.data % 64 == 0
        assert array.flags.c_contiguous
        assert not array.any()
