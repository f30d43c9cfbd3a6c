"""The counter between the workshops: what loads, what is refused, and how arrays go through."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import runtime
from runtime.errors import LibraryError, NotRealisableError, ShapeError
from runtime.library import Library, binding, load, to_pinocchio_order
from runtime.library.binding import PART
from symgen.build import build
from symgen.compiler import sha256_of
from symgen.request import BuildRequest, RobotConfig
from tests.oracle import random_states

PRINTED_LINK_7 = [1.2543, 0.0057, 0.0108, -0.0203, 9e-4, 8e-4, 3e-4, -1e-4, 2e-4, 4e-4]
"""Table B.4: rounding made a body that cannot exist."""


# --- opening ------------------------------------------------------------------------------


def test_loads_by_folder_and_by_name(tiny: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: by path, by Path, and by name from ./generated."""
    tiny.parent.rename(tiny.parents[1] / "generated")
    monkeypatch.chdir(tiny.parents[1])
    for how in ("tiny", "generated/tiny", Path("generated/tiny").resolve()):
        lib = runtime.load(how)
        assert lib.name == "tiny"
        assert (lib.joint_names, lib.link_names, lib.n_joints) == (("swing",), ("rod",), 1)
    assert repr(lib) == f"Library('tiny', 1 joints, {len(lib.base_columns)} base parameters)"


def test_unknown_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: says where it looked and what to run."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LibraryError, match=r"called 'r2d2' .*symgen build --urdf FILE --name r2d2"):
        load("r2d2")
    with pytest.raises(LibraryError, match=r"holds no manifest.json; run: python -m symgen build"):
        load(tmp_path / "r2d2")


def damage_remove_library(folder: Path) -> None:
    for name in ("libtiny.so", "compile.json"):  # from its C code it would be compiled
        (folder / name).unlink()


def damage_truncate_library(folder: Path) -> None:
    os.truncate(folder / "libtiny.so", 5000)


def damage_empty_library(folder: Path) -> None:
    (folder / "libtiny.so").write_bytes(b"")


def damage_flip_one_byte(folder: Path) -> None:
    data = bytearray((folder / "libtiny.so").read_bytes())
    data[len(data) // 2] ^= 1
    (folder / "libtiny.so").write_bytes(data)


def damage_remove_record(folder: Path) -> None:
    (folder / "build.json").unlink()


def damage_garble_record(folder: Path) -> None:
    (folder / "build.json").write_text("[]")


def damage_change_manifest(folder: Path) -> None:
    path = folder / "manifest.json"
    path.write_text(path.read_text().replace('"velocity": 3.0', '"velocity": 4.0'))


def damage_truncate_manifest(folder: Path) -> None:
    os.truncate(folder / "manifest.json", 100)


def damage_empty_manifest(folder: Path) -> None:
    (folder / "manifest.json").write_text("{}")


def damage_old_format(folder: Path) -> None:
    path = folder / "manifest.json"
    path.write_text(path.read_text().replace('"format": 4', '"format": 0'))


def damage_remove_manifest(folder: Path) -> None:
    (folder / "manifest.json").unlink()


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (damage_remove_library, "holds neither a compiled library nor a compile.json"),
        (damage_truncate_library, "is damaged or not the one built here"),
        (damage_empty_library, "is damaged or not the one built here"),
        (damage_flip_one_byte, "is damaged or not the one built here"),
        (damage_remove_record, "has no valid build.json"),
        (damage_garble_record, "has no valid build.json"),
        (damage_change_manifest, "is older than its manifest.json"),
        (damage_truncate_manifest, "is damaged .not JSON."),
        (damage_empty_manifest, "is damaged .no valid 'format'."),
        (damage_old_format, "has the format 0, this runtime reads 4"),
        (damage_remove_manifest, "holds no manifest.json"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_damage_is_refused(tiny: Path, damage: Callable[[Path], None], message: str) -> None:
    """Property: one sentence with what to run; a truncated object never reaches the loader."""
    damage(tiny)
    with pytest.raises(LibraryError, match=f"{message}.*; run: python -m symgen build"):
        load(tiny)


def test_library_of_another_robot(tiny: Path, fr3: Library) -> None:
    """Property: refused by its bytes, and by its symbols even if the record is forged."""
    shutil.copy(fr3.folder / "libfr3.so", tiny / "libtiny.so")
    with pytest.raises(LibraryError, match="not the one built here"):
        load(tiny)
    record = json.loads((tiny / "build.json").read_text())
    record["sha256"] = sha256_of(tiny / "libtiny.so")
    (tiny / "build.json").write_text(json.dumps(record))
    with pytest.raises(LibraryError, match=r"cannot be used here .*tiny_model_hash"):
        load(tiny)


def test_library_of_another_model_of_the_same_name(tiny: Path, tmp_path: Path) -> None:
    """Property: the model hash inside the library is compared, whatever the record says."""
    heavy = BuildRequest("tiny", (tiny / "tiny.urdf").read_text().replace('"1.5"', '"1.7"'))
    other = build(heavy, tmp_path / "other").folder
    shutil.copy(other / "libtiny.so", tiny / "libtiny.so")
    record = json.loads((tiny / "build.json").read_text())
    record["sha256"] = sha256_of(tiny / "libtiny.so")
    (tiny / "build.json").write_text(json.dumps(record))
    with pytest.raises(LibraryError, match=r"belongs to the model .*, its manifest to "):
        load(tiny)


def test_rebuilt_under_an_open_library(tiny: Path) -> None:
    """Property: a session that has the old build open gets the new one, and both keep working."""
    old = load(tiny)
    before = old.inverse_dynamics([0.3], [0.0], [0.0], old.pi0)
    heavy = BuildRequest("tiny", (tiny / "tiny.urdf").read_text().replace('"1.5"', '"3.0"'))
    build(heavy, tiny.parent)
    new = load(tiny)
    assert new.pi0[0] == 3.0
    assert new.manifest.model_hash != old.manifest.model_hash
    np.testing.assert_array_equal(old.inverse_dynamics([0.3], [0.0], [0.0], old.pi0), before)
    # Gravity's torque at rest is linear in the mass.
    np.testing.assert_allclose(
        new.inverse_dynamics([0.3], [0.0], [0.0], new.pi0), 2 * before, rtol=1e-14
    )


def test_read_only_folder_and_missing_urdf(tiny: Path) -> None:
    """Property: loading writes nothing; the URDF is asked for only when needed."""
    (tiny / "tiny.urdf").unlink()
    tiny.chmod(0o555)
    try:
        lib = load(tiny)
        with pytest.raises(LibraryError, match=r"tiny\.urdf' is missing; run"):
            lib.urdf()
    finally:
        tiny.chmod(0o755)


# --- facts --------------------------------------------------------------------------------


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
    config = RobotConfig((0.25,), (5.0,), (100.0,))
    lib = load(build(BuildRequest("tiny", tiny_request.urdf, config=config), tmp_path).folder)
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


# --- arrays -------------------------------------------------------------------------------


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


# --- bodies -------------------------------------------------------------------------------


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
    with pytest.raises(NotRealisableError, match=r"pi of fr3_link3, fr3_link7 belongs to no body"):
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


def test_results_do_not_depend_on_the_number_of_threads(fr3, monkeypatch):
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
    real = binding.ThreadPoolExecutor

    def watched(workers):
        seen.append(workers)
        return real(workers)

    monkeypatch.setattr(binding, "ThreadPoolExecutor", watched)
    lib = load(fr3.folder)
    lib.end_effector(np.zeros((5000, 7)))
    assert seen == []
    lib.regressor(*np.zeros((3, 12 * PART, 7)))
    assert seen == [3]


def test_threads_are_at_least_one(fr3):
    """Property: zero threads are refused in a sentence."""
    with pytest.raises(LibraryError, match="threads must be at least 1, got 0"):
        load(fr3.folder, threads=0)
