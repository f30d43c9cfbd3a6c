"""The pipeline: what is built when, and what is reported."""

import ctypes
import json
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

import symgen.make.facts
from runtime.library import load
from symgen.chain import ChainOptions, read_chain
from symgen.make import bundled_robots
from symgen.make.pipeline import build, generate, is_current
from symgen.make.request import BuildRequest, RobotConfig, bundled_request
from tests.conftest import REPOSITORY, TINY_URDF
from tests.robots import DATA
from tests.symgen.builds import heavier, mass, rebuild, snapshot


def test_second_build_does_nothing(tiny: Path, tiny_request: BuildRequest) -> None:
    """Property: nothing is touched when nothing changed, unless forced."""
    before = snapshot(tiny.parent)
    assert not build(tiny_request, tiny.parent).rebuilt
    assert snapshot(tiny.parent) == before
    assert build(tiny_request, tiny.parent, force=True).rebuilt
    after = snapshot(tiny.parent)
    text = [name for name in before if not name.endswith(".so")]
    assert all(after[name][0] == before[name][0] for name in text)


@pytest.mark.parametrize(
    "change",
    [
        {"options": ChainOptions(gravity=(0.0, 0.0, -1.62))},
        {"config": RobotConfig(home=(0.5,))},
        {"urdf": TINY_URDF.replace('"1.5"', '"1.6"')},
        {"project": True},
    ],
    ids=str,
)
def test_a_change_is_seen(tiny: Path, tiny_request: BuildRequest, change: dict) -> None:
    """Property: every input is part of the fingerprint."""
    fields = {"urdf": tiny_request.urdf} | change
    changed = BuildRequest("tiny", **fields)
    assert is_current(tiny_request, tiny)
    assert not is_current(changed, tiny)
    assert changed.fingerprint != tiny_request.fingerprint


def test_a_change_is_built(tiny: Path, tiny_request: BuildRequest) -> None:
    """Oracle: the torque of a level pendulum is m g 0.1 m."""
    # One division and the rounding of an arm 0.1 m long.
    assert mass(tiny) == pytest.approx(1.5, rel=1e-14)
    assert rebuild(heavier(tiny_request), tiny.parent)
    assert mass(tiny) == pytest.approx(2.5, rel=1e-14)


def test_other_levels_are_another_build(tiny: Path, tiny_request: BuildRequest) -> None:
    """Property: a library for one instruction set is current for that request alone."""
    assert build(tiny_request, tiny.parent, levels=["portable"]).rebuilt
    assert load(tiny).levels == ("portable",)
    assert is_current(tiny_request, tiny)
    assert not build(tiny_request, tiny.parent, levels=["portable"]).rebuilt
    assert build(tiny_request, tiny.parent).rebuilt
    # A process keeps the library that it has open, so the record of the build decides.
    commands = json.loads((tiny / "build.json").read_text())["commands"]
    assert any("reference.c" in command for command in commands)


@pytest.mark.parametrize(
    "name", ["kernels.c", "manifest.json", "tiny.h", "libtiny.so", "build.json", "tiny.urdf"]
)
def test_missing_or_edited_files_are_rebuilt(
    tiny: Path, tiny_request: BuildRequest, name: str
) -> None:
    """Property: a lost or edited file of the folder makes it not current."""
    path = tiny / name
    data = path.read_bytes()
    path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    assert not is_current(tiny_request, tiny)
    path.unlink()
    assert not is_current(tiny_request, tiny)


def test_same_input_same_bytes(tiny_built: Path, tiny_request: BuildRequest) -> None:
    """Property: generated text depends on nothing but the request."""
    files, _ = generate(tiny_request)
    for name, text in files.items():
        assert (tiny_built / name).read_text(encoding="utf-8") == text, name
    other = BuildRequest("tiny", tiny_request.urdf.replace("tiny", "other"))
    assert generate(other)[0]["kernels.c"] != files["kernels.c"]  # the model's hash


def test_generated_text_names_no_machine(tiny_built: Path) -> None:
    """Property: no path of this machine and no date in the files that are committed."""
    for path in tiny_built.iterdir():
        if path.suffix not in {".so"} and path.name != "build.json":
            text = path.read_text(encoding="utf-8")
            assert str(tiny_built.parent) not in text, path.name
            assert str(REPOSITORY) not in text, path.name
            assert time.strftime("%Y-%m") not in text, path.name


@pytest.mark.parametrize("robot", bundled_robots())
def test_committed_code_is_in_sync(robot: str) -> None:
    """Oracle: the reviewed artefacts are what the code generates now."""
    committed = REPOSITORY / "generated" / robot
    if not (committed / "manifest.json").exists():
        pytest.skip(f"generated/{robot} is not part of this installation")
    for name, text in generate(bundled_request(robot))[0].items():
        assert (committed / name).read_text(encoding="utf-8") == text, (
            f"{name} is stale: python -m symgen build"
        )


def test_notes_report_what_was_done() -> None:
    """Property: lumped, cut and projected bodies are reported to the user."""
    text = (DATA / "tree.urdf").read_text()
    options = ChainOptions(tip="left_arm")
    notes = generate(BuildRequest("t", text, options))[1]
    assert "link 'camera' (0.2 kg) is fixed to 'trunk' and is part of its body" in notes
    assert "cut off by --base/--tip: left_hand, right_arm" in notes
    impossible = TINY_URDF.replace('izz="0.01"', 'izz="0.5"')
    notes = generate(BuildRequest("t", impossible, project=True))[1]
    assert any(
        "the inertia of 'rod' is not physically consistent and was projected" in note
        for note in notes
    )


def test_rounded_angles_are_reported() -> None:
    """Property: 3.1416 hides a right angle that the setting snap finds; 0.5 and π hide none."""
    tilted = TINY_URDF.replace('<origin xyz="0 0 0.5"/>', '<origin xyz="0 0 0.5" rpy="ANGLE 0 0"/>')
    assert tilted != TINY_URDF
    for angle, snap, is_reported in (
        ("3.1416", 0.0, True),
        ("3.1416", 1e-4, False),
        ("3.141592653589793", 0.0, False),
        ("0.5", 0.0, False),
    ):
        chain = read_chain(tilted.replace("ANGLE", angle), ChainOptions(snap=snap))
        notes = symgen.make.facts.notes_of(chain, {})
        assert (
            any("angles of swing" in note and "--settings snap=0.0001" in note for note in notes)
            == is_reported
        )


def test_c_code_alone_is_enough(tiny_built: Path, tmp_path: Path) -> None:
    """Oracle: *.c and *.h copied elsewhere compile without this project and compute the same."""
    for name in ("kernels.c", "reference.c", "tiny.h"):
        shutil.copy(tiny_built / name, tmp_path)
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler on the PATH")
    command = [compiler, "-shared", "-fPIC", "-o", "a.so", "kernels.c", "reference.c", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    pi0 = np.array(json.loads((tiny_built / "manifest.json").read_text())["pi0"])
    function = ctypes.CDLL(str(tmp_path / "a.so")).tiny_inverse_dynamics
    q, out = np.zeros(1), np.zeros(1)
    function(*(ctypes.c_void_p(a.ctypes.data) for a in (q, q, q, pi0, out)))
    assert out[0] == pytest.approx(-1.5 * 9.81 * 0.1, rel=1e-14)
