"""Identification with a free base: recovery of virtual bodies, choices of rows, contacts, files."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.errors import RuntimeFault
from runtime.estimators.convex.entropic_prior import prior_of
from runtime.estimators.prior_file import read_prior
from runtime.estimators.regression.factor import reduce
from runtime.estimators.uncertainty import vague_posterior
from runtime.identification.free_base.drives import _student, rms
from runtime.identification.free_base.result import FreeBaseIdentification
from runtime.identification.free_base.rows import (
    OFFSET_SIGMA,
    FreeBaseRows,
    contact_jacobian,
    rows_of,
)
from runtime.identification.identify import identify
from runtime.library import Library, to_pinocchio_order
from runtime.recording.free_base import free_base_of
from runtime.recording.preprocessing.free_base_motion import motion_of
from tests.free_base_logs import VirtualLog, virtual_log
from tests.robots import DATA
from tests.runtime.conftest import Command

HOPPER = (DATA / "hopper.urdf").read_text()
FEET = ("left_foot", "right_thigh")


@pytest.fixture(scope="module")
def lib(hopper: Library) -> Library:
    return hopper


@pytest.fixture(scope="module")
def log() -> VirtualLog:
    return virtual_log(HOPPER, FEET, 0)


def without(log: VirtualLog, *keys: str, **more: object) -> dict[str, np.ndarray]:
    kept = {key: value for key, value in log.arrays.items() if key not in keys}
    return kept | {key: np.array(value) for key, value in more.items()}


def identified(
    lib: Library, arrays: dict[str, np.ndarray], rows: str = "all", **options: Any
) -> FreeBaseIdentification:
    return identify(free_base_of(arrays, "log"), lib, rows=rows, **options)


def base_error(lib: Library, log: VirtualLog, result: FreeBaseIdentification) -> float:
    """‖β̂ − β‖ / ‖β‖."""
    change = lib.base_matrix @ (result.pi - true_pi(lib, log))
    return float(np.linalg.norm(change) / np.linalg.norm(lib.base_matrix @ true_pi(lib, log)))


def true_pi(lib: Library, log: VirtualLog) -> np.ndarray:
    names = np.arange(10.0)
    order = np.argsort(to_pinocchio_order(names))
    return log.pi.reshape(-1, 10)[:, order].ravel()


@pytest.mark.parametrize("rows", ["all", "base", "joints"])
def test_bodies_are_recovered(lib: Library, log: VirtualLog, rows: str) -> None:
    """Oracle: torques and wrenches of Pinocchio; every choice of rows fits them.

    The six base rows determine all base parameters by themselves.
    """
    result = identified(lib, log.arrays, rows)
    # The prior keeps a share of about its γ = 1e-4 of the residuals; exact data leave nothing else.
    size = rms(result.predictions["measured"])
    assert (np.array(result.record.torque_rms.after) < 1e-3 * size.max()).all()
    assert (
        np.array(result.record.torque_rms.before) > 30 * np.array(result.record.torque_rms.after)
    ).any()
    assert result.record.consistent
    if rows != "joints":
        assert base_error(lib, log, result) < 1e-3
        total = true_pi(lib, log)[::10].sum()
        assert result.record.total_mass.value == pytest.approx(total, rel=1e-3)
    vertical = result.record.vertical_force
    assert vertical is not None
    assert vertical.before_percent > 10 * vertical.after_percent or rows == "joints"
    # Oracle: the rank of all rows; torques of joints do not contain the ten parameters of the base.
    base = lib.base_matrix
    all_rows = rows_of(lib, motion_of(free_base_of(log.arrays, "log"), lib.joint_names), rows)
    rank = np.linalg.matrix_rank(all_rows.samples.base_rows(lib).reshape(-1, len(base)))
    assert result.record.uncertainty.excited == rank == len(base) - (10 if rows == "joints" else 0)


def test_unknown_wrenches_are_eliminated(lib: Library, log: VirtualLog) -> None:
    """Oracle: rows of the null space of the contact Jacobian hold for the true bodies."""
    arrays = without(log, "contact_wrench", contact_flags=np.tile([1, 0], (600, 1)))
    arrays["contact_wrench"] = log.arrays["contact_wrench"].copy()
    arrays["contact_wrench"][:, 0] = np.nan  # the first foot has no sensor
    del arrays["contact_flags"]
    motion = motion_of(free_base_of(arrays, "log"), lib.joint_names)
    rows = rows_of(lib, motion, "all")
    assert rows.samples.equations == 3
    residual = rows.samples.rigid(lib, true_pi(lib, log)) - rows.samples.tau
    assert np.abs(residual).max() < 1e-6 * np.abs(rows.samples.tau).max()
    result = identified(lib, arrays)
    size = rms(result.predictions["measured"])
    assert (np.array(result.record.torque_rms.after) < 0.02 * size).all()
    with pytest.raises(RuntimeFault, match="leave no equation; give contact_wrench"):
        identified(lib, arrays, "base")


def test_vertical_forces_alone_tell_the_mass(lib: Library, log: VirtualLog) -> None:
    """Oracle: one equation per instant, ΣF_z; the interval of the total mass holds it."""
    motion = motion_of(free_base_of(log.arrays, "log"), lib.joint_names)
    poses = lib.link_poses(motion.q)
    force = np.stack(
        [
            np.einsum("nj,nj->n", poses[:, lib.link_names.index(foot), 2, :3], wrench)
            for foot, wrench in zip(
                FEET, np.moveaxis(log.arrays["contact_wrench"], 1, 0)[:, :, :3], strict=True
            )
        ],
        axis=1,
    )
    force += np.random.default_rng(1).normal(0, 0.3, force.shape)
    arrays = without(log, "contact_wrench", "tau", contact_force_z=force)
    result = identified(lib, arrays, "base")
    assert len(result.record.error_rows) == 1
    assert any("1 of 6 equations per instant" in note for note in result.record.warnings)
    total, whole = result.record.total_mass.value, result.record.total_mass.sigma
    n_pi = lib.pi0.size
    sigma = np.linalg.norm(
        np.delete(result.posterior.pi_root, np.s_[n_pi:-1], axis=1)[::10].sum(axis=0)
    )
    assert abs(total - true_pi(lib, log)[::10].sum()) < 4 * sigma < 0.5
    # An offset of 1 N of either sensor is √2 N / g of mass where the robot only stands.
    assert whole == pytest.approx(np.hypot(sigma, np.sqrt(2) / 9.81), rel=0.1)
    vertical = result.record.vertical_force
    assert vertical is not None
    before, after = (
        x * vertical.mean / 100 for x in (vertical.before_percent, vertical.after_percent)
    )
    assert after < 0.5 < before  # noise is 0.3 √2
    assert any("prior-dominated" in each.verdicts for each in result.record.uncertainty.links)
    assert any(
        "constant offsets of the contact sensors of 1 N" in note for note in result.record.warnings
    )
    # A sensor that reads 5 N too much: where the log states such offsets, they are estimated with
    # that prior. This motion tells m a from the offset, so that the mass comes out right.
    arrays["contact_force_z"] = force + np.array([5.0, 0.0])
    wrong = abs(
        identified(lib, arrays, "base").record.total_mass.value - true_pi(lib, log)[::10].sum()
    )
    arrays["contact_force_z_sigma"] = np.array([4.0, 4.0])
    shifted = identified(lib, arrays, "base")
    total_error = abs(shifted.record.total_mass.value - true_pi(lib, log)[::10].sum())
    assert wrong > 4 * sigma
    assert total_error < 0.25 * wrong
    assert total_error < 4 * shifted.record.total_mass.sigma < 0.5
    assert not any(note.startswith("sensors:") for note in shifted.record.warnings)
    arrays["contact_force_z_sigma"] = np.array([0.5, 0.5])
    notes = identified(lib, arrays, "base").record.warnings
    assert any("the error of left_foot is" in note for note in notes)


def test_intervals_contain_constant_offsets_of_wrench_sensors(
    lib: Library, log: VirtualLog
) -> None:
    """Oracle: a wrench that reads σ more in one component moves β by the column of its offset.

    Noise of 0.2 N and 0.01 N·m leaves the prior a share of some percent. Without the columns a
    force of 1 N is far outside of the interval of the total mass.
    """
    wrench = log.arrays["contact_wrench"]
    noise = np.random.default_rng(2).normal(size=wrench.shape) * np.repeat([0.2, 0.01], 3)
    arrays = log.arrays | {"contact_wrench": wrench + noise}
    first = identified(lib, arrays, "base")
    columns, n_pi = first.posterior.pi_root[:, lib.pi0.size : -1], lib.pi0.size
    assert columns.shape == (n_pi, 12)
    for component in (2, 4):
        changed = arrays["contact_wrench"].copy()
        changed[:, 1, component] += OFFSET_SIGMA[component]
        second = identified(lib, arrays | {"contact_wrench": changed}, "base")
        moved = lib.base_matrix @ (second.pi - first.pi)
        column = lib.base_matrix @ columns[:, 6 + component]
        assert np.abs(column - moved).max() < 0.1 * np.abs(moved).max()
        error = abs(second.record.total_mass.value - true_pi(lib, log)[::10].sum())
        assert error < 2 * second.record.total_mass.sigma
        if component == 2:
            bare = np.delete(second.posterior.pi_root, np.s_[n_pi:-1], axis=1)[::10].sum(axis=0)
            assert error > 3 * np.linalg.norm(bare)


def test_offsets_count_only_while_the_sensor_is_read(lib: Library, log: VirtualLog) -> None:
    """Oracle: the column of an offset is the change of the right side by 1 N of that sensor."""
    count = len(log.arrays["t"])
    flags = np.tile([1, 1], (count, 1))
    flags[: count // 2, 1] = 0
    arrays = without(log, "contact_wrench", "tau", contact_flags=flags)
    arrays["contact_force_z_sigma"] = np.array([4.0, 4.0])
    force = np.full((count, 2), 100.0)

    def right(values: np.ndarray) -> FreeBaseRows:
        recording = free_base_of(arrays | {"contact_force_z": values}, "log")
        return rows_of(lib, motion_of(recording, lib.joint_names), "base")

    before = right(force)
    for foot in range(2):
        changed = right(force + np.eye(2)[foot])
        # The basis of the null space is the same: it depends on the Jacobian alone.
        step = changed.samples.tau - before.samples.tau
        np.testing.assert_allclose(before.samples.columns[..., foot], step, rtol=0, atol=1e-9)
    assert not before.samples.columns[: count // 2, :, 1].any()


def test_few_independent_rows_do_not_outweigh_the_prior(lib: Library, log: VirtualLog) -> None:
    """Property: a low-pass that leaves fewer values than unknowns leaves the prior where it is.

    Filtered at 0.5 Hz, 3.6 s hold four independent values of ΣF_z; residuals of a fit to them show
    no noise. The robot sways by 2 mrad, and the sensor's error follows it by 1 N: without a floor
    the fit explains it by bodies that weigh a multiple of the URDF's.
    """
    arrays = without(log, "contact_wrench", "tau", contact_force_z_sigma=[4.0, 4.0])
    t = log.arrays["t"]
    # A robot that stands: the pose of the first instant, its weight and the ripple.
    for key in ("q", "dq", "ddq", "base_pose", "base_twist", "base_acceleration"):
        if key in arrays:
            arrays[key] = np.repeat(arrays[key][:1] * (key in {"q", "base_pose"}), len(t), axis=0)
    arrays["q"] = arrays["q"] + 2e-3 * np.sin(3 * t)[:, None]
    weight = 9.81 * true_pi(lib, log)[::10].sum()
    ripple = np.sin(3.0 * t)
    arrays["contact_force_z"] = np.stack([weight / 2 + ripple, np.full(len(t), weight / 2)], axis=1)
    result = identified(lib, arrays, "base", cutoff=0.5)
    total, sigma = result.record.total_mass.value, result.record.total_mass.sigma
    assert abs(total - true_pi(lib, log)[::10].sum()) < 2 * sigma
    vertical = result.record.vertical_force
    assert vertical is not None
    # The ripple that is left after the low-pass, 0.43 N, and the offset's 1 N; 1.6 N without floor.
    assert vertical.after_percent * vertical.mean < 100 * 1.3
    assert any("4 independent equations" in note for note in result.record.warnings)


def test_derivatives_and_poses(lib: Library, log: VirtualLog) -> None:
    """Oracle: twist and acceleration of the simulation from the pose alone, by differences."""
    arrays = without(log, "dq", "ddq", "base_twist", "base_acceleration")
    exact = motion_of(free_base_of(log.arrays, "log"), lib.joint_names)
    motion = motion_of(free_base_of(arrays, "log"), lib.joint_names)
    inner = slice(5, -5)
    # Differences at 100 Hz of sines up to 9 rad/s: (ω h)²/6 = 0.14 % once, twice that for ddq.
    assert np.abs(motion.dq - exact.dq)[inner].max() < 0.002 * np.abs(exact.dq).max()
    assert np.abs(motion.ddq - exact.ddq)[inner].max() < 0.006 * np.abs(exact.ddq).max()
    filtered = motion_of(free_base_of(log.arrays, "log"), lib.joint_names, 20.0)
    assert np.abs(filtered.ddq - exact.ddq)[60:-60].max() < 0.01 * np.abs(exact.ddq).max()
    matrices = without(log, "base_pose")
    matrices["base_pose"] = lib.link_poses(exact.q)[:, 0]
    again = motion_of(free_base_of(matrices, "log"), lib.joint_names)
    np.testing.assert_allclose(again.q, exact.q, rtol=0, atol=1e-9)


def test_command(lib: Library, log: VirtualLog, tmp_path: Path, command: Command) -> None:
    """Property: `identify the setting rows` writes result.json and a URDF with the base link's
    inertial.
    """
    path, out = tmp_path / "walk.npz", tmp_path / "out"
    np.savez(path, **without(log, contact_axes="link"))
    done = command("identify", path, "--robot", lib.folder, "--settings", "rows=base", "--out", out)
    assert done.code == 0, done.err
    assert "total mass" in done.out
    facts = json.loads((out / "result.json").read_text())
    low, high = facts["total_mass"]["interval"]
    assert low < true_pi(lib, log)[::10].sum() < high or abs(high - low) < 0.1
    assert [link["name"] for link in facts["links"]] == list(lib.link_names)
    assert (out / "identified.urdf").exists()
    rows = ("--settings", "rows=base", "--friction", "viscous", "--overwrite")
    done = command("identify", path, "--robot", lib.folder, *rows, "--out", out)
    assert done.code == 2
    assert "friction and delay belong to the torques of joints" in done.err


@pytest.mark.parametrize("words", [("inspect", "walk.npz"), ("excite",)])
def test_other_commands_refuse_a_free_base(
    lib: Library, log: VirtualLog, tmp_path: Path, command: Command, words: tuple[str, ...]
) -> None:
    """Property: exit code 2 and what to use instead."""
    np.savez(tmp_path / "walk.npz", **log.arrays)
    done = command(*words, "--robot", lib.folder)
    assert done.code == 2
    assert "this command needs a robot with a fixed base" in done.err


def test_prior_of_the_base_link(lib: Library, log: VirtualLog, tmp_path: Path) -> None:
    """Property: a known mass of the base link holds where the log tells only the total mass."""
    (tmp_path / "prior.toml").write_text("[link.body]\nmass = 7.5\n")
    prior = read_prior(tmp_path / "prior.toml", lib)
    still = np.broadcast_to(np.array([0, 0, 1, 0, 0, 0, 1.0]), (60, 7))
    force = np.tile([40.0, 70.0], (60, 1)) + np.random.default_rng(0).normal(0, 1, (60, 2))
    arrays = {
        "t": np.arange(60) / 20.0,
        "q": np.zeros((60, 3)),
        "base_pose": still,
        "contact_links": np.array(FEET),
        "contact_force_z": force,
    }
    free = identified(lib, arrays, "base")
    held = identified(lib, arrays, "base", prior=prior)
    assert held.pi[0] == pytest.approx(7.5, abs=0.01)
    assert abs(free.pi[0] - 7.5) > 0.1
    assert held.record.total_mass.value == pytest.approx(force.sum(axis=1).mean() / 9.81, rel=0.05)


BAD = {
    "no pose": ({}, ("base_pose",), "has no motion of the base"),
    "wrong shape": ({"base_twist": np.zeros((3, 6))}, (), "base_twist needs real numbers"),
    "misspelt": ({"base_poses": np.zeros(3)}, (), "has the array base_poses, expected"),
    "length": ({"base_pose": np.zeros((600, 7))}, (), "base_pose: .* another length than 1"),
    "no links": ({}, ("contact_links",), "no contact_links"),
    "axes": ({"contact_axes": "base"}, (), "contact_axes is 'base', expected one of link, world"),
    "fixed link": ({"contact_links": ["box", "body"]}, (), "it is fixed to 'body'"),
    "torque": ({}, ("tau",), "needs joint torques"),
    "joint": ({"joints": ["a", "b", "c"]}, (), "no joint 'left_hip' of the robot"),
    "offsets": ({"contact_force_z_sigma": [1.0, 1.0]}, (), "contact_force_z beside them"),
    "nan": ({"q": np.full((600, 3), np.nan)}, (), "q has NaN or infinite values"),
}


@pytest.mark.parametrize("case", BAD)
def test_damaged_logs_get_a_sentence(lib: Library, log: VirtualLog, case: str) -> None:
    """Property: expected, came, what to do."""
    changes, removed, sentence = BAD[case]
    with pytest.raises(RuntimeFault, match=sentence):
        identified(lib, without(log, *removed, **changes))


def test_what_means_and_sensors_explain_is_missing_in_the_residual() -> None:
    """Oracle: n − p of linear regression: σ of 12 independent values behind a mean and 4 columns.

    Columns whose coefficients are known explain nothing, and the mean one value.
    """
    rng = np.random.default_rng(0)
    rest, columns = rng.normal(size=(240, 1)), rng.normal(size=(240, 1, 4))
    for known, used in ((1e6, 5), (1e-6, 1)):
        few, many = (_student(rest, columns, np.full(4, known), n)[0] for n in (12.0, 240.0))
        assert few / many == pytest.approx(np.sqrt(12 / (12 - used) * (240 - used) / 240), rel=1e-3)


def test_equations_behind_unknown_wrenches_are_continuous(lib: Library, log: VirtualLog) -> None:
    """Property: the basis of the null space turns no faster than the Jacobian of the contact.

    A low-pass and an autocorrelation of the residuals need that; an SVD alone jumps.
    """
    arrays = without(log, contact_wrench=log.arrays["contact_wrench"].copy())
    arrays["contact_wrench"][:, 0] = np.nan
    motion = motion_of(free_base_of(arrays, "log"), lib.joint_names)
    rows = rows_of(lib, motion, "all")
    steps = np.linalg.norm(np.diff(rows.basis, axis=0), axis=(1, 2))
    turned = np.linalg.norm(np.diff(contact_jacobian(lib, motion)[:, :6], axis=0), axis=(1, 2))
    assert steps.max() < 2 * turned.max()


def test_what_the_prior_moves_counts_as_error(lib: Library, log: VirtualLog) -> None:
    """Oracle: the variance of π contains the square of its difference from the vague posterior."""
    arrays = without(
        log, tau=log.arrays["tau"] + 5 * np.random.default_rng(0).normal(size=(600, 3))
    )
    result = identified(lib, arrays, "joints")
    known = result.posterior.information
    data, _ = reduce(known.statistics, 9)
    scale = np.sqrt(known.density)
    vague, _ = vague_posterior(lib, prior_of(lib), data.factor / scale, data.target / scale)
    pull = result.pi - vague
    variance = np.sum(result.posterior.pi_root**2, axis=1)
    assert (variance > pull**2).all()
    assert np.sum(pull**2 > 0.2 * variance) > 3
