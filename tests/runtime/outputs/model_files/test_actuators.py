"""Files for those who train policies: actuators.yaml, and MJCF with gains and a delay note."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
import yaml

from runtime.library import Library
from tests.runtime.conftest import Command
from tests.runtime.servo_logs import KD, KP, random_servo, servo_arrays


def test_drives_reach_their_files(lib: Library, command: Command, tmp_path: Path) -> None:
    """Oracle: PyYAML and MuJoCo read the numbers of result.json, each with its σ."""
    rng = np.random.default_rng(0)
    arrays = servo_arrays(lib, random_servo(lib, rng), rng, seconds=8.0)
    arrays.pop("tau_true")
    np.savez(tmp_path / "servo.npz", **arrays)  # type: ignore[arg-type]
    words = (
        "--cutoff",
        "10",
        "--delay",
        "per-joint",
        "--settings",
        "encoder_bias=false",
        "--out",
        "out",
    )
    ran = command("identify", "servo.npz", "--robot", lib.folder, *words)
    assert ran.code == 0, ran.err
    ran = command("export", "out", "--robot", lib.folder, "--to", "mjcf,actuators")
    assert ran.code == 0, ran.out + ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    tables = yaml.safe_load((tmp_path / "out" / "export" / "actuators.yaml").read_text())
    group = tables["actuators"]["joints"]
    assert group["joint_names_expr"] == list(lib.joint_names)
    for delay, drive in zip(facts["delay_s"], facts["drive"], strict=True):
        name = drive["joint"]
        assert (group["stiffness"][name], group["damping"][name]) == (KP, KD)
        assert group["armature"][name] == drive["armature"]
        assert group["friction"][name] == group["dynamic_friction"][name] == drive["coulomb"]
        assert group["viscous_friction"][name] == drive["viscous"]
        assert tables["delay"][name] == delay["value"]
        assert tables["encoder_bias"][name] is None
        for key in ("armature", "viscous", "coulomb", "encoder_bias"):
            assert tables["sigma"][key][name] == drive["sigma"][key]
    text = (tmp_path / "out" / "export" / "fr3.xml").read_text()
    assert "the commanded torque acts" in text
    model = mujoco.MjModel.from_xml_string(text)
    armature = [drive["armature"] for drive in facts["drive"]]
    assert model.dof_armature == pytest.approx(armature, rel=1e-12)
    assert model.actuator_gainprm[:, 0] == pytest.approx(KP)
    assert -model.actuator_biasprm[:, 2] == pytest.approx(KD)


def test_a_measured_torque_has_no_actuators(
    lib: Library, command: Command, log: Path, tmp_path: Path
) -> None:
    """Property: a sentence with the remedy, no file, exit 2 where the format is named."""
    words = ("--friction", "viscous,coulomb", "--out", "out")
    assert command("identify", log, "--robot", lib.folder, *words).code == 0
    ran = command("export", "out", "--robot", lib.folder, "--to", "actuators")
    assert ran.code == 2
    assert "--delay auto" in ran.out
    assert not (tmp_path / "out" / "export" / "actuators.yaml").exists()
