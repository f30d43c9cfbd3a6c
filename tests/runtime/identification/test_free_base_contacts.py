"""Contacts of free bases: measured for a part of the time, in another order, by other writers."""

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from runtime.errors import RuntimeFault
from runtime.estimators.prior_file import read_prior
from runtime.identification.free_base.prepared_walk import require_contact_conventions
from runtime.identification.identify import identify
from runtime.identification.result_record import FORMAT
from runtime.library import Library
from runtime.recording.free_base import free_base_of
from runtime.recording.preprocessing.free_base_motion import motion_of
from tests.free_base_logs import HALF, Experiment, virtual_log
from tests.robots import DATA
from tests.runtime.conftest import Command

Arrays = dict[str, Any]
FEET = ("left_foot", "right_thigh")


@pytest.fixture(scope="module")
def arrays() -> Arrays:
    text = (DATA / "hopper.urdf").read_text()
    return virtual_log(text, FEET, 0, Experiment(count=200)).arrays


@pytest.mark.parametrize("rows", [slice(0, 100), slice(100, 200)])
def test_a_sensor_that_works_in_one_part_only(hopper: Library, arrays: Arrays, rows: slice) -> None:
    """Property: training and test part may have different numbers of equations per instant."""
    wrench = arrays["contact_wrench"].copy()
    wrench[rows, 0] = np.nan
    log = free_base_of(arrays | {"contact_wrench": wrench}, "log")
    result = identify(log, hopper, rows="all", split=HALF)
    assert len(result.record.torque_rms.after) == (9 if rows.start == 0 else 3)
    whole = identify(free_base_of(arrays, "log"), hopper, rows="all")
    mass, sigma = result.record.total_mass.value, result.record.total_mass.sigma
    # 95 % interval; exact data of six base rows determine the mass to rounding and prior.
    assert abs(mass - whole.record.total_mass.value) < 1.96 * sigma + 1e-6
    assert np.linalg.norm(result.record.torque_rms.after) < np.linalg.norm(
        result.record.torque_rms.before
    )


def test_exchanged_contacts_are_named(hopper: Library, arrays: Arrays) -> None:
    """Property: wrenches under the name of another contact are refused, with the right order."""
    links = arrays["contact_links"][::-1]
    with pytest.raises(RuntimeFault, match="expected right_thigh, left_foot in this order"):
        identify(
            free_base_of(arrays | {"contact_links": arrays["contact_links"],
                                   "contact_wrench": arrays["contact_wrench"][:, ::-1]}, "log"),
            hopper,
            rows="base",
        )  # fmt: skip
    with pytest.raises(RuntimeFault, match="contact_links"):
        identify(free_base_of(arrays | {"contact_links": links}, "log"), hopper, rows="all")


def test_columns_without_names_are_noted(hopper: Library, arrays: Arrays) -> None:
    """Property: where rows stay unexplained, a log without names of joints gets a note."""
    unnamed = {key: value for key, value in arrays.items() if key != "joints"}
    mixed = {key: arrays[key][:, [2, 0, 1]] for key in ("q", "dq", "ddq", "tau")}
    result = identify(free_base_of(unnamed | mixed, "log"), hopper, rows="joints")
    assert any("no array joints, which names them" in note for note in result.record.warnings)


def test_contacts_that_hide_every_row_name_what_is_missing(hopper: Library, arrays: Arrays) -> None:
    """Property: the sentence does not propose what the log and the command already state."""
    unknown = {key: value for key, value in arrays.items() if key != "contact_wrench"}
    everything = unknown | {"contact_flags": np.ones((200, 2))}
    with pytest.raises(RuntimeFault, match="leave no equation") as raised:
        identify(free_base_of(everything, "log"), hopper, rows="all")
    assert "--settings rows=all" not in str(raised.value)
    assert "contact_kind = 'point'" in str(raised.value)
    with pytest.raises(RuntimeFault, match="--settings rows=all"):
        identify(free_base_of(everything, "log"), hopper, rows="base")


def test_names_as_bytes(hopper: Library, arrays: Arrays) -> None:
    """Property: names of HDF5 and of older NumPy, which are bytes, are those of texts."""
    names = {key: np.array([str(x).encode() for x in arrays[key]]) for key in ("joints",)}
    names["contact_links"] = np.array([x.encode() for x in FEET])
    log = free_base_of(arrays | names, "log")
    assert log.contacts.links == FEET
    assert log.joint_names == tuple(arrays["joints"])


def test_bytes_of_another_encoding(hopper: Library, arrays: Arrays) -> None:
    """Property: a name in Latin-1 is one that the robot does not have, not a traceback."""
    links = np.array([b"fu\xdf", FEET[1].encode()])
    log = free_base_of(arrays | {"contact_links": links}, "log")
    with pytest.raises(RuntimeFault, match="fu\ufffd"):
        identify(log, hopper, rows="all")
    with pytest.raises(RuntimeFault, match="contact_kind is 'fl\ufffdche', expected one of"):
        free_base_of(arrays | {"contact_kind": np.array(b"fl\xe4che")}, "log")


@pytest.mark.parametrize(
    ("measured", "unit"), list(itertools.product(("dq", "base_twist", ""), (1e3, 1e6)))
)
def test_time_in_another_unit(hopper: Library, arrays: Arrays, measured: str, unit: float) -> None:
    """Property: milliseconds and microseconds are named by velocities, else by the rate."""
    gone = {"dq", "base_twist"} - {measured}
    kept = {key: value for key, value in arrays.items() if key not in gone}
    with pytest.raises(RuntimeFault, match=r"time looks like [mu]s|too low .* t in s"):
        identify(free_base_of(kept | {"t": unit * arrays["t"]}, "log"), hopper, cutoff=20.0)


def test_priors_of_joints_are_refused(hopper: Library, arrays: Arrays, tmp_path: Path) -> None:
    """Property: rotors have no place in equations without drives, and are not ignored."""
    path = tmp_path / "prior.toml"
    path.write_text(f"[armature]\n{hopper.joint_names[0]} = 0.1\n")
    with pytest.raises(
        RuntimeFault,
        match=r"the prior states \[armature\], and the equations .* or estimate friction",
    ):
        identify(free_base_of(arrays, "log"), hopper, rows="all", prior=read_prior(path, hopper))


def test_other_commands_read_the_result_of_a_free_base(
    hopper: Library, arrays: Arrays, tmp_path: Path, command: Command
) -> None:
    """Property: report, evaluate, export, sample and watch take it; observe says what it needs."""
    rng = np.random.default_rng(0)
    log = dict(arrays)
    for key, sigma in (("tau", 0.05), ("contact_wrench", 0.3)):
        log[key] = arrays[key] + sigma * rng.normal(size=arrays[key].shape)
    path, out = tmp_path / "walk.npz", tmp_path / "out"
    np.savez(path, **log)
    done = command(
        "identify", path, "--robot", hopper.folder, "--out", out, "--settings", "report=false"
    )
    assert done.code == 0, done.err
    assert not (out / "report.html").exists()
    facts = json.loads((out / "result.json").read_text())
    assert (facts["base"], facts["format"]) == ("free", FORMAT)
    done = command("evaluate", out, path, "--robot", hopper.folder, "--json")
    assert done.code == 0, done.err
    rms = json.loads(done.out)["rms"]
    assert (np.array(rms["after"]) < np.array(rms["before"])).all()
    for words in (("export", out, "--to", "urdf"), ("report", out)):
        assert command(*words).code == 0
    assert "force x" in (out / "report.html").read_text()
    done = command("sample", out, "--count", "2", "--to", "urdf")
    assert done.code == 0, done.err
    done = command("watch", out, path, "--robot", hopper.folder, "--json")
    assert (done.code, json.loads(done.out)["p_value"]) == (0, 1.0)
    done = command("observe", path, "--model", out, "--robot", hopper.folder)
    assert done.code == 2
    assert "needs a robot with a fixed base" in done.err
    done = command("export", out, "--to", "mjcf")
    assert (done.code, "use --to urdf" in done.out) == (2, True)
    (out / "result.json").write_text(json.dumps({"free_base": 1, "pi": []}))
    done = command("evaluate", out, path)
    assert done.code == 2
    assert "result of a robot with a free base of format 2 or earlier" in done.err


def test_sensors_that_read_nothing_in_the_test_part(hopper: Library, arrays: Arrays) -> None:
    """Property: errors in percent of a mean force need one; a test part without load has none."""
    wrench = arrays["contact_wrench"].copy()
    wrench[100:] = 0.0
    log = arrays | {"contact_wrench": wrench}
    result = identify(free_base_of(log, "log"), hopper, rows="base", split=HALF)
    assert result.record.vertical_force is None
    assert any("of the test part are zero throughout" in note for note in result.record.warnings)


def test_forces_without_gravity(
    hopper: Library, arrays: Arrays, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a robot without weight shows no unit of its vertical forces."""
    monkeypatch.setattr(hopper, "gravity", np.zeros(3))
    log = arrays | {"contact_axes": np.array("world")}
    motion = motion_of(free_base_of(log, "log"), hopper.joint_names)
    with pytest.raises(RuntimeFault, match="in axes of the link, and the log states"):
        require_contact_conventions(hopper, motion, "log")
