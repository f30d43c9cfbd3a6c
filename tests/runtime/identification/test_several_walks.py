"""Several walks in one fit: common bodies, friction and delay, offsets of sensors of each log."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.errors import RuntimeFault
from runtime.identification.identify import identify
from runtime.library import Library
from runtime.recording.free_base import FreeBaseRecording, free_base_of
from runtime.recording.preprocessing.free_base_motion import motion_of
from tests.free_base_logs import Experiment, VirtualLog, virtual_log
from tests.robots import DATA
from tests.runtime.conftest import Command
from tests.runtime.identification.test_free_base_commands import (
    DELAY_S,
    foot_log,
    true_pi,
    walk_by_commands,
)

Arrays = dict[str, Any]
HOPPER = (DATA / "hopper.urdf").read_text()
COUNT = 600
FEET = ("left_foot", "right_thigh")


@pytest.fixture(scope="module")
def log() -> VirtualLog:
    return virtual_log(HOPPER, FEET, 0, Experiment(count=COUNT))


@pytest.fixture(scope="module")
def noisy(log: VirtualLog) -> Arrays:
    rng = np.random.default_rng(2)
    sigma = {"contact_wrench": np.repeat([0.2, 0.01], 3), "tau": 0.05}
    return log.arrays | {
        key: log.arrays[key] + size * rng.normal(size=log.arrays[key].shape)
        for key, size in sigma.items()
    }


def part(arrays: Arrays, first: int, last: int, name: str) -> FreeBaseRecording:
    count = len(arrays["t"])
    cut = {key: x[first:last] if np.ndim(x) and len(x) == count else x for key, x in arrays.items()}
    return free_base_of(cut, name)


def halves(arrays: Arrays) -> list[FreeBaseRecording]:
    middle = len(arrays["t"]) // 2
    return [part(arrays, 0, middle, "one"), part(arrays, middle, 2 * middle, "two")]


@pytest.mark.parametrize("rows", ["all", "base"])
def test_one_walk_twice_is_one_walk(hopper: Library, noisy: Arrays, rows: str) -> None:
    """Oracle: least squares does not notice that every row is there twice; σ does."""
    walk = free_base_of(noisy, "walk")
    once, twice = (identify(each, hopper, "ols", rows=rows) for each in (walk, [walk, walk]))
    # Rounding times the condition number of the rows.
    np.testing.assert_allclose(twice.record.beta, once.record.beta, rtol=0, atol=1e-7)
    sessions = twice.record.sessions
    assert sessions is not None
    assert sessions.names == ("walk", "walk'")
    assert np.array(sessions.repeatability.beta_spread) == pytest.approx(0.0, abs=1e-12)
    assert "share 100 % of their rows" in sessions.repeatability.sentence
    assert any("give each log once" in note for note in twice.record.warnings)
    assert twice.record.torque_rms.after == pytest.approx(once.record.torque_rms.after, rel=1e-6)


@pytest.mark.parametrize("rows", ["all", "base", "joints"])
def test_two_halves_are_one_walk(hopper: Library, noisy: Arrays, rows: str) -> None:
    """Oracle: motion that is stated has the same rows in both, and so the same parameters."""
    whole, two = (
        identify(each, hopper, rows=rows) for each in (free_base_of(noisy, "walk"), halves(noisy))
    )
    # Rounding of two orders of compression times the condition number.
    np.testing.assert_allclose(two.record.beta, whole.record.beta, rtol=0, atol=1e-9)
    assert two.record.trained.pi != whole.record.trained.pi


def test_parameters_come_from_all_rows(hopper: Library, noisy: Arrays) -> None:
    """Property: errors are those of the training rows, parameters those of all rows."""
    walk = free_base_of(noisy, "walk")
    last, first = (identify(walk, hopper, refit=refit).record for refit in (True, False))
    assert first.trained is None
    assert last.trained.pi == first.pi
    assert last.torque_rms == first.torque_rms
    assert last.vertical_force == first.vertical_force
    assert any("fitted to all 600 rows; errors are" in note for note in last.warnings)
    assert last.uncertainty.n_eff > 1.3 * first.uncertainty.n_eff


def test_intervals_shrink_and_hold_the_mass(
    hopper: Library, log: VirtualLog, noisy: Arrays
) -> None:
    """Oracle: bodies of Pinocchio; offsets of 1 N of either log are independent."""
    logs = halves(noisy)
    alone = [identify(each, hopper).record.total_mass for each in logs]
    record = identify(logs, hopper).record
    mass, true = record.total_mass, true_pi(log)[::10].sum()
    assert mass.interval[0] < true < mass.interval[1]
    assert mass.sigma == pytest.approx(sum(each.sigma**-2 for each in alone) ** -0.5, rel=0.15)
    assert record.sessions.repeatability.ratio < 2
    for each in record.sessions.leave_one_out:
        assert each.single_log_overall <= each.log_offset_overall <= each.after_overall
        assert each.after_overall < 0.1 * each.before_overall


def test_offsets_belong_to_one_log(hopper: Library, log: VirtualLog) -> None:
    """Oracle: the difference of the offsets of two logs, whose robot has one mass.

    ΣF_z alone determines the sum of the offsets of the feet, and with the mass exchanges both.
    """
    rng, arrays = np.random.default_rng(3), dict(log.arrays)
    poses = hopper.link_poses(motion_of(free_base_of(arrays, "log"), hopper.joint_names).q)
    turns = poses[:, [hopper.link_names.index(foot) for foot in FEET], 2, :3]
    force = np.einsum("ncj,ncj->nc", turns, arrays.pop("contact_wrench")[..., :3])
    force += 0.1 * rng.normal(size=force.shape)
    arrays["contact_force_z_sigma"] = np.array([4.0, 4.0])
    planted = {"one": (3.0, 0.0), "two": (-2.0, 1.0)}
    logs = [
        part(arrays | {"contact_force_z": force + offset}, *ends, name)
        for (name, offset), ends in zip(planted.items(), ((0, 300), (300, 600)), strict=True)
    ]
    sensors = identify(logs, hopper, rows="base").record.sensors
    assert list(sensors) == [f"{foot} of {walk}" for walk in planted for foot in FEET]
    one, two = (sum(sensors[f"{foot} of {walk}"].value for foot in FEET) for walk in planted)
    # Noise of 0.14 N over 180 rows, and the prior, which draws both sums to zero.
    assert one - two == pytest.approx(3.0 - (-2.0 + 1.0), abs=0.1)


def test_friction_and_delay_are_common(hopper: Library) -> None:
    """Oracle: planted delay and mass; both logs together determine more than either."""
    log = foot_log()
    logs = halves(walk_by_commands(log))
    alone = [identify(each, hopper, cutoff=15.0).record for each in logs]
    record = identify(logs, hopper, cutoff=15.0).record
    delay = record.delay_s
    assert abs(delay.value - DELAY_S) < 4 * delay.sigma + 1e-4
    assert delay.sigma < min(each.delay_s.sigma for each in alone)
    mass = record.total_mass
    assert abs(mass.value - true_pi(log)[::10].sum()) < 4 * mass.sigma


def test_logs_of_other_rates_count_alike(hopper: Library) -> None:
    """Property: five rows per period of the low-pass, whatever rate and origin a clock has."""
    arrays = walk_by_commands(foot_log())
    count = len(arrays["t"])
    half = {
        key: x[count // 2 :: 2] if np.ndim(x) and len(x) == count else x
        for key, x in arrays.items()
    }
    half["t"] = half["t"] + 1e9
    logs = [part(arrays, 0, count // 2, "one"), free_base_of(half, "two")]
    one, two = identify(logs, hopper, cutoff=5.0, delay=DELAY_S).record.sessions.train_samples
    assert abs(one - two) <= 1


def test_logs_that_do_not_fit_together(hopper: Library, noisy: Arrays) -> None:
    """Property: one set of contacts, and one kind of torque."""
    one, _ = halves(noisy)
    commanded = noisy | {"tau_command": noisy["tau"]}
    del commanded["tau"]
    with pytest.raises(RuntimeFault, match="some of the logs hold commanded torques"):
        identify([one, free_base_of(commanded, "two")], hopper)
    other = noisy | {"contact_position": np.full((2, 3), 0.01)}
    with pytest.raises(RuntimeFault, match=r"two has other contacts .* \(position\)"):
        identify([one, free_base_of(other, "two")], hopper)
    opposite = noisy | {"contact_wrench": -noisy["contact_wrench"]}
    with pytest.raises(RuntimeFault, match=r"^two: the contact wrenches are opposite"):
        identify([one, free_base_of(opposite, "two")], hopper)
    with pytest.raises(RuntimeFault, match="expected a log, as runtime"):
        identify([one, one.joints], hopper)


def test_command(hopper: Library, noisy: Arrays, tmp_path: Path, command: Command) -> None:
    """Property: the command gives the digits of Python, states how well the logs agree, and what
    reads a result of one walk reads that of several.
    """
    names = []
    for name, ends in (("one", (0, 300)), ("two", (300, 600))):
        cut = {key: x[slice(*ends)] if len(x) == COUNT else x for key, x in noisy.items()}
        np.savez(tmp_path / f"{name}.npz", **cut)
        names.append(f"{name}.npz")
    done = command("identify", *names, "--robot", hopper.folder)
    assert done.code == 0, done.err
    assert "repeatability: the base parameters of single logs spread" in done.out
    out = tmp_path / "results" / "one-2-all"
    facts = json.loads((out / "result.json").read_text())
    result = identify(halves(noisy), hopper)
    assert facts["pi"] == list(result.pi)
    assert facts["recording"]["name"] == "one.npz + two.npz"
    assert [each["name"] for each in facts["sessions"]["leave_one_out"]] == names
    assert set(facts["provenance"]["files"]) == set(names)
    assert "Leave-one-log-out" in (out / "report.html").read_text()
    for words in (("evaluate", out, "two.npz"), ("watch", out, "two.npz"),
                  ("sample", out, "--count", "1", "--to", "urdf")):  # fmt: skip
        done = command(*words)
        assert done.code == 0, done.err
    done = command("identify", *names, "--robot", hopper.folder, "--overwrite", "--verbose")
    assert "Leave one log out" in done.out
