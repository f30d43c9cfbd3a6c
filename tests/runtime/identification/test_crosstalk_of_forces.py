"""Vertical force sensors that read a part of the moment, and that pass a low-pass of their own."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from runtime.errors import RuntimeFault
from runtime.identification.free_base.drives import vertical_force
from runtime.identification.free_base.identify import identify_free_base
from runtime.identification.free_base.rows import contact_jacobian, contact_moments
from runtime.identification.settings import Settings
from runtime.library import Library
from runtime.recording.free_base import FreeBaseRecording, free_base_of
from runtime.recording.preprocessing.free_base_motion import motion_of
from tests.free_base_logs import HALF, virtual_log
from tests.runtime.conftest import Command

FEET = ("left_foot", "right_thigh")
CUTOFF, BOUNCE = 3.0, 2.0
"""Low-pass of the sensors, and frequency of the motion [Hz]."""
CROSSTALK = 0.4
"""[N per N·m]."""
Arrays = dict[str, np.ndarray]


def log(lib: Library, t: np.ndarray, **others: np.ndarray) -> Arrays:
    """The hopper on its left foot, at rest where `others` do not state a motion."""
    pose = np.tile([0, 0, 1, 0, 0, 0, 1.0], (len(t), 1))
    fixed = {"t": t, "q": np.zeros((len(t), lib.n_joints)), "base_pose": pose}
    return fixed | {"contact_links": np.array(FEET[:1])} | others


def bouncing(lib: Library) -> Arrays:
    """A base on a sine; the driver of the sensor has H = 1 / (1 + i f / f_c)."""
    t = np.arange(600) / 100.0
    pose = np.tile([0, 0, 1, 0, 0, 0, 1.0], (len(t), 1))
    angle, size = 2 * np.pi * BOUNCE * t, 0.02
    pose[:, 2] += size * np.sin(angle)
    mass = lib.pi0[::10].sum()
    ratio = BOUNCE / CUTOFF
    slow = np.sin(angle - np.arctan(ratio)) / np.hypot(1.0, ratio)
    force = mass * (9.81 - size * (2 * np.pi * BOUNCE) ** 2 * slow)
    return log(lib, t, base_pose=pose, contact_force_z=force[:, None])


def error_of_urdf(lib: Library, arrays: Arrays) -> float:
    """RMS error of ΣF_z [N] 0.5 s from either end, behind all transients."""
    motion = motion_of(free_base_of(arrays, "log"), lib.joint_names)
    inner = motion.rows(np.arange(50, len(motion) - 50))
    found = vertical_force(lib, inner, lib.pi0, np.zeros(0))
    assert found is not None
    return found.before_percent * found.mean / 100


def test_motion_passes_the_low_pass_of_the_sensors(hopper: Library) -> None:
    """Oracle: gain and phase of a first-order low-pass at the frequency of the bounce.

    The forces of the motion are 33 N; the lag loses 0.55 of them. What is left is the digital
    filter at 2 Hz, exact at 3 Hz (bilinear: (π f h)²/3 = 1e-3 of 33 N), and differences of a sine
    of 50 samples (1e-3).
    """
    arrays = bouncing(hopper)
    lagged = error_of_urdf(hopper, arrays | {"contact_force_z_cutoff": np.array(CUTOFF)})
    assert lagged < 0.1
    assert error_of_urdf(hopper, arrays) > 10.0


def test_moments_and_forces_of_the_contacts_hold_the_base(hopper: Library) -> None:
    """Oracle: Σ J_cᵀ w_c is the wrench on the base that the motion needs, for any shares."""
    urdf = (Path(__file__).parents[2] / "data" / "hopper.urdf").read_text()
    arrays = virtual_log(urdf, FEET, 3).arrays
    arrays["contact_position"] = np.array([[0.1, 0.0, -0.2], [0.0, 0.3, 0.0]])
    motion = motion_of(free_base_of(arrays, "log"), hopper.joint_names)
    part = np.random.default_rng(0).uniform(0.0, 1.0, len(motion))
    shares = np.stack([part, 1 - part], axis=1)
    needed = hopper.inverse_dynamics(motion.q, motion.dq, motion.ddq, hopper.pi0)[:, :6]
    world = np.einsum("nij,nj->ni", motion.rotation, needed[:, :3])
    poses = hopper.link_poses(motion.q)
    turns = [poses[:, hopper.link_names.index(foot), :3, :3] for foot in FEET]
    wrench = np.concatenate(
        [
            np.stack([np.einsum("nji,nj->ni", r, world) for r in turns], axis=1)
            * shares[:, :, None],
            contact_moments(hopper, motion, shares),
        ],
        axis=2,
    )
    jacobian = contact_jacobian(hopper, motion)[:, :, :6]
    held = np.einsum("nck,nc->nk", jacobian, wrench.reshape(len(motion), -1))
    # Rounding of forces of 100 N at levers of 1 m.
    np.testing.assert_allclose(held, needed, rtol=0, atol=1e-10)


@pytest.fixture(scope="module")
def swinging(hopper: Library) -> Arrays:
    """Legs that swing slowly; the sensor reads a part of the moment about y.

    The moment is that of the weight about the contact, r × W z with the centre of mass of
    Pinocchio. From 7 to 8 s the sensor is shaken, and reads 2 N per N·m less.
    """
    urdf = (Path(__file__).parents[2] / "data" / "hopper.urdf").read_text()
    model = pinocchio.buildModelFromXML(urdf, pinocchio.JointModelFreeFlyer())
    data = model.createData()
    t = np.arange(1000) / 50.0
    q = 0.2 * np.sin(2 * np.pi * t[:, None] * [0.11, 0.13, 0.17])
    foot = model.getFrameId(FEET[0])
    weight = 9.81 * sum(body.mass for body in model.inertias)
    moment = np.empty(len(t))
    for k, row in enumerate(q):
        at = np.concatenate([[0, 0, 1, 0, 0, 0, 1.0], row])
        com = pinocchio.centerOfMass(model, data, at)
        pinocchio.framesForwardKinematics(model, data, at)
        place = data.oMf[foot]
        moment[k] = (place.rotation.T @ np.cross(com - place.translation, [0, 0, weight]))[1]
    read = weight + CROSSTALK * moment
    read += np.random.default_rng(2).normal(0.0, 0.05, len(t))
    shaken = (t > 7.0) & (t < 8.0)
    read[shaken] -= 2.0 * (moment - moment.mean())[shaken]
    return log(hopper, t, q=q, contact_force_z=read[:, None]) | {
        "contact_force_z_crosstalk": np.array([0.0, 0.5])
    }


def test_crosstalk_is_estimated_from_the_quiet_part(hopper: Library, swinging: Arrays) -> None:
    """Oracle: c of the simulated sensor, from a log with a shaken part.

    The legs' accelerations of 0.1 N, which the simulated force neglects, over moments of 10 N·m
    are 0.01. With equal weights of all instants c is 0.373.
    """
    recording = free_base_of(swinging, "log")
    result = identify_free_base(
        [recording], hopper, Settings(rows="base", cutoff=1.0, split=HALF), trim_s=0.5
    )
    assert result.record.sensors["crosstalk_y"].value == pytest.approx(CROSSTALK, abs=0.01)
    assert set(result.record.sensors) == {"crosstalk_y"}  # no part of the moment about x is stated
    vertical = result.record.vertical_force
    assert vertical is not None
    assert vertical.after_percent * vertical.mean < 100 * 0.1
    assert vertical.before_percent * vertical.mean > 100 * 10.0


def low_of(value: object) -> Callable[[Arrays], Arrays]:
    return lambda arrays: arrays | {"contact_force_z_cutoff": np.array(value)}


def crosstalk_of(value: object) -> Callable[[Arrays], Arrays]:
    return lambda arrays: arrays | {"contact_force_z_crosstalk": np.array(value)}


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (low_of(0.0), "contact_force_z_cutoff needs a number above 0"),
        (low_of(-3.0), "contact_force_z_cutoff needs a number above 0"),
        (low_of(25.0), "contact_force_z_cutoff is 25 Hz, expected a value below 25 Hz"),
        (low_of([3.0, 3.0]), "contact_force_z_cutoff"),
        (crosstalk_of([0.5, -0.5]), "contact_force_z_crosstalk needs two numbers of at least 0"),
        (crosstalk_of(0.5), "contact_force_z_crosstalk"),
    ],
)
def test_damaged_properties_get_a_sentence(
    hopper: Library, swinging: Arrays, damage: Callable[[Arrays], Arrays], words: str
) -> None:
    """Property: the sentence names the array and what is expected."""

    def read() -> FreeBaseRecording:
        recording = free_base_of(damage(swinging), "log")
        motion_of(recording, hopper.joint_names)
        return recording

    with pytest.raises(RuntimeFault, match=words):
        read()


def test_command_states_the_crosstalk(
    hopper: Library, swinging: Arrays, tmp_path: Path, command: Command
) -> None:
    """Property: the output names the axis and the unit."""
    np.savez(tmp_path / "walk.npz", **swinging | {"contact_force_z_cutoff": np.array(5.0)})
    done = command(
        *("identify", tmp_path / "walk.npz", "--robot", hopper.folder, "--settings", "rows=base"),
        *("--cutoff", "1", "--out", tmp_path / "out"),
    )
    assert done.code == 0, done.err
    assert "N per N·m about y of the link" in done.out
    assert "about x of the link" not in done.out
    assert "not read" not in done.out
