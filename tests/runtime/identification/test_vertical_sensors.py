"""Errors of the sensors of vertical contact forces: offsets, and readings while load is shared."""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import RuntimeFault
from runtime.identification.free_base.result import FreeBaseIdentification
from runtime.identification.free_base.rows import FreeBaseRows, rows_of
from runtime.identification.identify import identify
from runtime.library import Library
from runtime.recording.free_base import free_base_of
from runtime.recording.preprocessing.free_base_motion import motion_of
from tests.free_base_logs import HALF
from tests.runtime.conftest import Command

FEET = ("left_foot", "right_thigh")
GAMMA, OFFSET = 0.08, 3.0
WEIGHT = 120.0
"""Mass of the hopper times g is near it [N]; the mass is to be found."""


def standing(read: bool = True) -> dict[str, np.ndarray]:
    """A robot that shifts its weight from one foot to the other, at rest.

    Args:
        read: whether the sensors have errors.

    Returns:
        Arrays of a log of 20 s.
    """
    t = np.arange(400) / 20.0
    left = np.clip(0.5 + 0.9 * np.sin(0.8 * t), 0.0, 1.0)
    share = np.stack([left, 1 - left], axis=1)
    force = WEIGHT * share
    if read:
        # F_read = F (1 + γ (1 − s)) + o, with the share of the forces that act.
        force = force * (1 + GAMMA * (1 - share)) + np.array([OFFSET, 0.0])
    return {
        "t": t,
        "q": np.zeros((len(t), 3)),
        "base_pose": np.broadcast_to(np.array([0, 0, 1, 0, 0, 0, 1.0]), (len(t), 7)),
        "contact_links": np.array(FEET),
        "contact_force_z": force + np.random.default_rng(0).normal(0, 0.1, force.shape),
    }


def identified(lib: Library, arrays: dict[str, np.ndarray]) -> FreeBaseIdentification:
    return identify(free_base_of(arrays, "log"), lib, rows="base", split=HALF)


def test_reading_of_shared_load_is_estimated(hopper: Library) -> None:
    """Oracle: γ of the simulated sensors; without its column the error on the test part is larger.

    The offset is not told from the mass by a robot at rest, so that its prior is small here. The
    share in the column is that of the readings, 2 % off where γ is 0.08: γ has that error too.
    """
    arrays = standing() | {"contact_force_z_sigma": np.array([0.01, 0.01])}
    arrays["contact_force_z"] = arrays["contact_force_z"] - np.array([OFFSET, 0.0])
    plain = identified(hopper, arrays)
    result = identified(hopper, arrays | {"contact_force_z_sharing": np.array(0.1)})
    assert result.record.sensors["sharing"].value == pytest.approx(GAMMA, rel=0.05)
    # The sum of both feet reads 2 γ s (1 − s) too much, up to 4.8 N.
    assert result.record.total_mass.value * 9.81 == pytest.approx(WEIGHT, abs=0.3)
    assert abs(plain.record.total_mass.value * 9.81 - WEIGHT) > 1.0
    forces = [each.record.vertical_force for each in (result, plain)]
    after, without = (each.after_percent * each.mean / 100 for each in forces)
    assert after < 0.2 < 5 * after < without
    # The errors of the rows are those of ΣF_z, one equation per instant.
    assert result.record.torque_rms.after[0] == pytest.approx(after, rel=1e-6)


def test_two_sensors_of_a_foot_have_offsets_of_their_own(hopper: Library) -> None:
    """Property: heel and toe are two contacts of one link; the result names both."""
    arrays = standing(read=False) | {"contact_links": np.array([FEET[0], FEET[0]])}
    arrays |= {"contact_position": np.array([[-0.1, 0, 0], [0.1, 0, 0]])}
    arrays |= {"contact_force_z_sigma": np.array([5.0, 0.0])}
    result = identified(hopper, arrays)
    offsets = [name for name in result.record.sensors if name.startswith(FEET[0])]
    assert offsets == [f"{FEET[0]} 1", f"{FEET[0]} 2"]


def test_noise_is_that_of_sensors_within_their_prior(hopper: Library) -> None:
    """Property: a γ that is stated as next to 0 explains no residual, so σ of the mass stays.

    A low-pass of 0.5 Hz leaves 10 independent values of 10 s. Of σ, 1e-6 is the smallest γ.
    """
    recordings = [
        free_base_of(standing() | more, "log")
        for more in ({}, {"contact_force_z_sharing": np.array(1e-9)})
    ]
    without, exact = (
        identify(recording, hopper, rows="base", cutoff=0.5, split=HALF).record
        for recording in recordings
    )
    assert exact.total_mass.value == pytest.approx(without.total_mass.value, rel=1e-6)
    assert exact.total_mass.sigma == pytest.approx(without.total_mass.sigma, rel=1e-6)


def test_columns_are_the_change_of_the_right_side(hopper: Library) -> None:
    """Oracle: the right side with forces that a γ of 1e-3 has changed, by difference."""
    arrays = standing(read=False) | {"contact_force_z_sharing": np.array(0.1)}
    force = arrays["contact_force_z"]
    share = force / force.sum(axis=1, keepdims=True)

    def right(values: np.ndarray) -> FreeBaseRows:
        recording = free_base_of(arrays | {"contact_force_z": values}, "log")
        return rows_of(hopper, motion_of(recording, hopper.joint_names), "base")

    before, after = right(force), right(force * (1 + 1e-3 * (1 - share)))
    step = (after.samples.tau - before.samples.tau) / 1e-3
    # Rounding of forces of 120 N in a difference of 1e-3: 120 · 2.2e-16 / 1e-3.
    np.testing.assert_allclose(before.samples.columns[..., 0], step, rtol=0, atol=1e-9)


@pytest.mark.parametrize("value", [-0.1, np.nan, [0.1, 0.1]])
def test_damaged_sharing_gets_a_sentence(hopper: Library, value: object) -> None:
    """Property: one number of at least 0 is expected."""
    with pytest.raises(RuntimeFault, match="contact_force_z_sharing"):
        identified(hopper, standing() | {"contact_force_z_sharing": np.array(value)})
    alone = standing() | {"contact_force_z_sharing": np.array(0.1)}
    del alone["contact_force_z"]
    with pytest.raises(RuntimeFault, match="contact_force_z beside it"):
        identified(hopper, alone)


def test_command_states_the_sensors(hopper: Library, tmp_path: Path, command: Command) -> None:
    """Property: result.json and the output name offsets by link, and γ."""
    arrays = standing() | {
        "contact_force_z_sigma": np.array([5.0, 5.0]),
        "contact_force_z_sharing": np.array(0.1),
    }
    np.savez(tmp_path / "walk.npz", **arrays)
    done = command(
        "identify", tmp_path / "walk.npz", "--robot", hopper.folder, "--out", tmp_path / "out"
    )
    assert done.code == 0, done.err
    assert "sensors: γ = +0.0" in done.out
    assert f"sensors: offset of {FEET[0]} " in done.out
    assert "links: this motion does not identify all parameters of " in done.out
    assert "not identifiable m" not in done.out
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert set(facts["sensors"]) == {*FEET, "sharing"}
    assert all(each["sigma"] > 0 for each in facts["sensors"].values())
