"""Watch of a robot with a free base, on logs that Pinocchio computed."""

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from runtime.errors import RuntimeFault
from runtime.identification.free_base.rows import contact_jacobian
from runtime.identification.identify import identify
from runtime.identification.posterior_file import read_posterior
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import SavedResult, read_result
from runtime.library import Library
from runtime.library.parameters import MASS, link_columns
from runtime.monitoring.drift import Verdict, free_baseline_of, verdict_of
from runtime.recording.free_base import free_base_of
from runtime.recording.preprocessing.free_base_motion import motion_of
from tests.free_base_logs import Array, Experiment, virtual_log
from tests.robots import DATA
from tests.runtime.conftest import Command

Arrays = dict[str, Array]
CARRIED = 1.0
"""Mass that the body carries later [kg]; with links of 20 % other bodies the robot has 8 kg."""
NOISE = Experiment(count=2400, changed=0.2, torque_noise=0.003, force_noise=0.5, moment_noise=0.05)


@dataclass(frozen=True)
class Watched:
    """A result by the first half of a log, and the second half."""

    folder: Path
    saved: SavedResult
    root: Array
    first: Arrays
    second: Arrays

    def verdict(self, lib: Library, arrays: Arrays) -> Verdict:
        """Verdict on a log."""
        log = free_base_of(arrays, "later")
        return verdict_of(lib, free_baseline_of(lib, self.saved, self.root, log), log)


@pytest.fixture(scope="module", params=["all", "base"])
def watched(request, hopper: Library, tmp_path_factory) -> Watched:
    log = virtual_log((DATA / "hopper.urdf").read_text(), ("left_foot",), 3, NOISE)
    first, second = (
        {key: x[part] if len(x) == NOISE.count else x for key, x in log.arrays.items()}
        for part in (slice(0, 1200), slice(1200, None))
    )
    folder = tmp_path_factory.mktemp("watched")
    result = identify(free_base_of(first, "first"), hopper, rows=request.param, cutoff=10.0)
    write_result(result, folder, "test")
    saved = read_result(folder)
    root = read_posterior(folder, saved, hopper).of_readings().root(hopper)
    return Watched(folder, saved, root, first, second)


def loaded(lib: Library, arrays: Arrays) -> Arrays:
    """The log of a robot that carries a body of `CARRIED` at (.05, 0, .1) m of its first link."""
    place, pi = np.array([0.05, 0.0, 0.1]), np.zeros_like(lib.pi0)
    moment = CARRIED * (place @ place * np.eye(3) - np.outer(place, place)) + 1e-3 * np.eye(3)
    pi[link_columns(0)] = CARRIED * np.array([1, *place, *np.zeros(6)])
    pi[4:10] = moment[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    motion = motion_of(free_base_of(arrays, "log"), lib.joint_names)
    force = lib.inverse_dynamics(motion.q, motion.dq, motion.ddq, pi)
    jacobian = contact_jacobian(lib, motion)
    wrench = np.linalg.solve(jacobian[:, :, :6].swapaxes(1, 2), force[:, :6, None])[..., 0]
    torque = force[:, 6:] - np.einsum("ncj,nc->nj", jacobian[:, :, 6:], wrench)
    order = [list(arrays["joints"]).index(name) for name in lib.joint_names]
    more = np.zeros_like(arrays["tau"])
    more[:, order] = torque
    wrenches = arrays["contact_wrench"] + wrench.reshape(arrays["contact_wrench"].shape)
    return arrays | {"tau": arrays["tau"] + more, "contact_wrench": wrenches}


def test_nothing_is_named_on_another_part_of_the_motion(hopper: Library, watched: Watched) -> None:
    """Property: a part of the motion that was not fitted shows no change."""
    verdict = watched.verdict(hopper, watched.second)
    assert not verdict.changed
    assert verdict.error < 2


def test_a_body_that_is_carried_is_named(hopper: Library, watched: Watched) -> None:
    """Oracle: forces and torques of the body; the mass is within its interval."""
    verdict = watched.verdict(hopper, loaded(hopper, watched.second))
    best = verdict.best
    assert verdict.changed
    assert (best.group, best.where) == ("payload", hopper.link_names[0])
    assert best.interval is not None
    assert best.interval[0] < CARRIED < best.interval[1]
    assert best.interval[1] - best.interval[0] < 0.3 * CARRIED
    assert watched.saved.pi[MASS] > 0


@pytest.mark.parametrize(("group", "size"), [("sensor gain", 20.0), ("sensor bias", 2.5)])
def test_a_torque_sensor_is_named(
    hopper: Library, watched: Watched, group: str, size: float
) -> None:
    """Oracle: a torque × 1.2, or with 2.5 N more; rows of the base alone do not contain it."""
    tau = watched.second["tau"].copy()
    joint = 0 if group == "sensor gain" else 1
    tau[:, joint] = tau[:, joint] * 1.2 if group == "sensor gain" else tau[:, joint] + size
    verdict = watched.verdict(hopper, watched.second | {"tau": tau})
    if watched.saved.record.rows == "base":
        assert not verdict.changed
        return
    assert verdict.changed
    assert (verdict.best.group, verdict.best.where) == (group, str(watched.second["joints"][joint]))
    assert verdict.best.interval is not None
    assert verdict.best.interval[0] < size < verdict.best.interval[1]


def test_an_accelerometer_without_a_force_sensor(hopper: Library, tmp_path: Path) -> None:
    """Oracle: noise of the accelerometer is in every equation, and no change; a body is named."""
    noisy = virtual_log((DATA / "hopper.urdf").read_text(), ("left_foot",), 4, NOISE).arrays
    shape = noisy["base_acceleration"].shape
    rng = np.random.default_rng(4)
    noisy["base_acceleration"] = noisy["base_acceleration"] + 0.05 * rng.normal(size=shape)

    def half(part: slice, arrays: Arrays) -> Arrays:
        cut = {key: x[part] if len(x) == NOISE.count else x for key, x in arrays.items()}
        return {key: x for key, x in cut.items() if key != "contact_wrench"}

    first = half(slice(0, 1200), noisy)
    result = identify(free_base_of(first, "first"), hopper, rows="all", cutoff=10.0)
    write_result(result, tmp_path / "result", "test")
    saved = read_result(tmp_path / "result")
    root = read_posterior(tmp_path / "result", saved, hopper).of_readings().root(hopper)
    watched = Watched(tmp_path, saved, root, first, half(slice(1200, None), noisy))
    assert not watched.verdict(hopper, watched.second).changed
    best = watched.verdict(hopper, half(slice(1200, None), loaded(hopper, noisy))).best
    assert (best.group, best.where) == ("payload", hopper.link_names[0])
    assert best.interval is not None
    assert best.interval[0] < CARRIED < best.interval[1]


def test_a_model_by_commands_may_be_wrong_by_more_than_its_interval(
    hopper: Library, tmp_path: Path
) -> None:
    """Oracle: base parameters that are wrong by 3 σ, as on simulated walks, are no change."""
    log = virtual_log((DATA / "hopper.urdf").read_text(), ("left_foot",), 5, NOISE).arrays
    log["tau_command"] = log.pop("tau")
    del log["contact_wrench"]
    first, second = (
        {key: x[part] if len(x) == NOISE.count else x for key, x in log.items()}
        for part in (slice(0, 1200), slice(1200, None))
    )
    folder = tmp_path / "result"
    write_result(identify(free_base_of(first, "first"), hopper, cutoff=10.0), folder, "test")
    saved = read_result(folder)
    posterior = read_posterior(folder, saved, hopper).of_readings()
    root, over_pi = posterior.root(hopper), posterior.pi_root
    changed = []
    for seed in range(4):
        wrong = 3.0 * over_pi @ np.random.default_rng(seed).normal(size=over_pi.shape[1])
        result = Watched(folder, replace(saved, pi=saved.pi + wrong), root, first, second)
        changed.append(result.verdict(hopper, second).changed)
    assert not any(changed)
    tau = second["tau_command"] * np.where(np.arange(len(second["joints"])) == 0, 1.2, 1.0)
    faulty = Watched(folder, saved, root, first, second).verdict(
        hopper, second | {"tau_command": tau}
    )
    assert (faulty.best.group, faulty.best.where) == ("sensor gain", str(second["joints"][0]))
    assert faulty.changed


def test_command(hopper: Library, watched: Watched, command: Command, tmp_path: Path) -> None:
    """Property: exit code 1 for a change; the log of the model itself has p = 1."""
    for name, arrays in (("first", watched.first), ("pack", loaded(hopper, watched.second))):
        np.savez(tmp_path / f"{name}.npz", **arrays)  # type: ignore[arg-type]
    words = ("--robot", hopper.folder, "--json")
    same = command("watch", watched.folder, "first.npz", *words)
    assert (same.code, json.loads(same.out)["p_value"]) == (0, 1.0)
    ran = command("watch", watched.folder, "pack.npz", *words, "--history", "history.jsonl")
    assert ran.code == 1
    assert json.loads(ran.out)["group"] == "payload"
    (entry,) = map(json.loads, (tmp_path / "history.jsonl").read_text().splitlines())
    digest = hashlib.sha256((tmp_path / "pack.npz").read_bytes()).hexdigest()
    assert entry["log_sha256"] == {"pack.npz": digest}
    refused = command("watch", watched.folder, "pack.npz", *words[:2], "--recipe", "fr3")
    assert refused.code == 2
    assert "--recipe does not apply to a log of a free base" in refused.err


def test_a_short_log_is_refused(hopper: Library, watched: Watched) -> None:
    """Property: half a second of motion is too short, in a sentence."""
    short = {k: x[:50] if len(x) == 1200 else x for k, x in watched.second.items()}
    with pytest.raises(RuntimeFault, match="give a longer log"):
        watched.verdict(hopper, short)
