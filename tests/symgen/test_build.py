"""The pipeline: repeated, changed, doubled, killed and starved builds."""

import ctypes
import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest

import symgen.build
import symgen.exchange
from runtime.library import load
from symgen.build import build, generate, is_current
from symgen.chain import ChainOptions, read_chain
from symgen.errors import BuildError, CompilerError, SymgenError, UrdfError
from symgen.request import (
    BuildRequest,
    RobotConfig,
    bundled_request,
    read_config,
    request_from_folder,
)
from tests.conftest import REPOSITORY, TINY_URDF
from tests.robots import DATA


def snapshot(folder: Path) -> dict[str, tuple[bytes, int]]:
    """Bytes and modification time of every file, lock files aside."""
    return {
        path.relative_to(folder).as_posix(): (path.read_bytes(), path.stat().st_mtime_ns)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.endswith(".lock")
    }


def heavier(request: BuildRequest, kilograms: str = "2.5") -> BuildRequest:
    return BuildRequest(request.name, request.urdf.replace('"1.5"', f'"{kilograms}"'))


def mass(folder: Path) -> float:
    """Mass that the library really computes with: τ at rest, arm level, is 0.1 m g."""
    lib = load(folder)
    return float(lib.inverse_dynamics([0.0], [0.0], [0.0], lib.pi0)[0] / (-9.81 * 0.1))


# --- when nothing, and when something has to be done ----------------------------------------


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
    assert build(heavier(tiny_request), tiny.parent).rebuilt
    assert mass(tiny) == pytest.approx(2.5, rel=1e-14)


def test_other_levels_are_another_build(tiny: Path, tiny_request: BuildRequest) -> None:
    """Property: a library for one instruction set is current for that request alone."""
    assert build(tiny_request, tiny.parent, levels=["portable"]).rebuilt
    assert load(tiny).levels == ("portable",)
    assert is_current(tiny_request, tiny)
    assert not build(tiny_request, tiny.parent, levels=["portable"]).rebuilt
    assert build(tiny_request, tiny.parent).rebuilt
    # A process keeps the library that it has open, so the record of the build tells.
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
    robot, _ = generate(tiny_request)
    for name, text in robot.files.items():
        assert (tiny_built / name).read_text(encoding="utf-8") == text, name
    other = BuildRequest("tiny", tiny_request.urdf.replace("tiny", "other"))
    assert generate(other)[0].files["kernels.c"] != robot.files["kernels.c"]  # the model's hash


def test_generated_text_names_no_machine(tiny_built: Path) -> None:
    """Property: no path of this machine and no date in the files that are committed."""
    for path in tiny_built.iterdir():
        if path.suffix not in {".so"} and path.name != "build.json":
            text = path.read_text(encoding="utf-8")
            assert str(tiny_built.parent) not in text, path.name
            assert str(REPOSITORY) not in text, path.name
            assert time.strftime("%Y-%m") not in text, path.name


def test_committed_fr3_is_in_sync() -> None:
    """Oracle: the reviewed artefacts are what the code generates now."""
    committed = REPOSITORY / "generated" / "fr3"
    if not (committed / "manifest.json").exists():
        pytest.skip("generated/fr3 is not part of this installation")
    for name, text in generate(bundled_request("fr3"))[0].files.items():
        assert (committed / name).read_text(encoding="utf-8") == text, (
            f"{name} is stale: python -m symgen build"
        )


# --- when something goes wrong ----------------------------------------------------------------


def no_space(*_: object, **__: object) -> NoReturn:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("stage", ["_write_files", "_compile", "replace_folder"])
def test_full_disk_leaves_the_old_library(
    tiny: Path, tiny_request: BuildRequest, stage: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: ENOSPC at any stage is one sentence; the old library and nothing else remains."""
    before = snapshot(tiny.parent)
    with monkeypatch.context() as patch:
        patch.setattr(symgen.build, stage, no_space)
        with pytest.raises(BuildError, match=r"cannot write '.*tiny'.*previous library.*unchanged"):
            build(heavier(tiny_request), tiny.parent)
    assert snapshot(tiny.parent) == before
    assert mass(tiny) == pytest.approx(1.5, rel=1e-14)
    assert build(heavier(tiny_request), tiny.parent).rebuilt


def test_half_written_file(
    tiny: Path, tiny_request: BuildRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: the disk fills up in the middle of the third file."""
    written, original = [], Path.write_text

    def write(path: Path, text: str, *args: object, **kwargs: object) -> int:
        written.append(path)
        if len(written) == 3:
            original(path, text[: len(text) // 2])
            no_space()
        return original(path, text, *args, **kwargs)

    before = snapshot(tiny.parent)
    monkeypatch.setattr(Path, "write_text", write)
    with pytest.raises(BuildError, match="No space left on device"):
        build(heavier(tiny_request), tiny.parent)
    assert snapshot(tiny.parent) == before


def test_refused_compilation_leaves_the_old_library(
    tiny: Path, tiny_request: BuildRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a compiler that fails changes nothing."""
    before = snapshot(tiny.parent)
    monkeypatch.setenv("CC", "false")
    with pytest.raises(CompilerError, match="'false "):
        build(heavier(tiny_request), tiny.parent)
    assert snapshot(tiny.parent) == before


def test_bad_urdf_leaves_the_old_library(tiny: Path) -> None:
    """Property: so does a URDF that cannot be read."""
    before = snapshot(tiny.parent)
    with pytest.raises(UrdfError):
        build(BuildRequest("tiny", "<robot/>"), tiny.parent)
    assert snapshot(tiny.parent) == before


def test_folder_that_cannot_be_made(tmp_path: Path, tiny_request: BuildRequest) -> None:
    """Property: a file where the folder should be, or a name too long, is one sentence."""
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(BuildError, match="cannot write"):
        build(tiny_request, tmp_path / "taken")
    with pytest.raises(BuildError, match="cannot write"):
        build(BuildRequest("a" * 300, TINY_URDF), tmp_path)
    assert (tmp_path / "taken").read_text() == "a file"


def test_foreign_files_survive(tiny: Path, tiny_request: BuildRequest) -> None:
    """Property: a user's own files and folders beside the generated ones are kept."""
    (tiny / "notes.txt").write_text("mine")
    (tiny / "meshes").mkdir()
    (tiny / "meshes" / "rod.stl").write_text("solid")
    build(heavier(tiny_request), tiny.parent)
    assert (tiny / "notes.txt").read_text() == "mine"
    assert (tiny / "meshes" / "rod.stl").read_text() == "solid"
    assert mass(tiny) == pytest.approx(2.5, rel=1e-14)


def test_exchange_without_renameat2(
    tiny: Path, tiny_request: BuildRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: where the system cannot exchange folders, two renames do, and undo themselves."""
    monkeypatch.setattr(symgen.exchange, "_exchange", lambda a, b: False)
    assert build(heavier(tiny_request), tiny.parent).rebuilt
    assert mass(tiny) == pytest.approx(2.5, rel=1e-14)
    before = snapshot(tiny.parent)
    original = Path.rename

    def rename(path: Path, target: Path) -> Path:
        if target == tiny and not path.name.endswith(".old"):
            no_space()
        return original(path, target)

    monkeypatch.setattr(Path, "rename", rename)
    with pytest.raises(BuildError, match="No space left"):
        build(tiny_request, tiny.parent)
    assert snapshot(tiny.parent) == before


# --- two at once, and the killed one ------------------------------------------------------------

BUILD = """
import sys
from pathlib import Path
from symgen.build import build
from symgen.request import BuildRequest
build(BuildRequest("tiny", Path(sys.argv[1]).read_text()), Path(sys.argv[2]), force=True)
"""
BUILD_AND_HANG = """
import sys, time
from pathlib import Path
import symgen.build
from symgen.request import BuildRequest
stage = getattr(symgen.build, sys.argv[3])
def hang(*arguments):
    if sys.argv[3] != "replace_folder":
        stage(*arguments)
    print("here", flush=True)
    time.sleep(float(sys.argv[4]))
setattr(symgen.build, sys.argv[3], hang)
symgen.build.build(BuildRequest("tiny", Path(sys.argv[1]).read_text()), Path(sys.argv[2]))
"""


def child(code: str, *arguments: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        cwd=REPOSITORY,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_two_builds_at_once(tmp_path: Path, tiny_request: BuildRequest) -> None:
    """Property: two processes, two models, one folder: a whole library of one of them remains."""
    light, heavy = tmp_path / "light.urdf", tmp_path / "heavy.urdf"
    light.write_text(tiny_request.urdf)
    heavy.write_text(heavier(tiny_request).urdf)
    root = tmp_path / "out"
    children = [child(BUILD, urdf, root) for urdf in (light, heavy)]
    for one in children:
        _, complaint = one.communicate(timeout=60)
        assert one.returncode == 0, complaint
    assert any(mass(root / "tiny") == pytest.approx(m, rel=1e-14) for m in (1.5, 2.5))
    assert [path.name for path in root.iterdir() if path.is_dir()] == ["tiny"]


def test_second_build_waits_for_the_first(
    tiny: Path, tiny_request: BuildRequest, tmp_path: Path
) -> None:
    """Property: a build that starts while another is half done neither harms nor overtakes it."""
    light = tmp_path / "light.urdf"
    light.write_text(heavier(tiny_request, "0.5").urdf)
    first = child(BUILD_AND_HANG, light, tiny.parent, "_write_files", 0.5)
    assert first.stdout is not None
    assert first.stdout.readline() == "here\n"
    assert build(heavier(tiny_request), tiny.parent).rebuilt
    _, complaint = first.communicate(timeout=60)
    assert first.returncode == 0, complaint
    assert mass(tiny) == pytest.approx(2.5, rel=1e-14)


def test_waiting_build_takes_what_the_first_has_built(
    tiny: Path, tiny_request: BuildRequest, tmp_path: Path
) -> None:
    """Property: two processes that want the same robot compile it once."""
    heavy = tmp_path / "heavy.urdf"
    heavy.write_text(heavier(tiny_request).urdf)
    first = child(BUILD_AND_HANG, heavy, tiny.parent, "_write_files", 0.5)
    assert first.stdout is not None
    assert first.stdout.readline() == "here\n"
    assert not build(heavier(tiny_request), tiny.parent).rebuilt
    _, complaint = first.communicate(timeout=60)
    assert first.returncode == 0, complaint
    assert mass(tiny) == pytest.approx(2.5, rel=1e-14)


@pytest.mark.parametrize("stage", ["_write_files", "_compile", "replace_folder"])
def test_killed_build(tiny: Path, tiny_request: BuildRequest, tmp_path: Path, stage: str) -> None:
    """Property: SIGKILL after any stage leaves the old library loadable and the next build free."""
    heavy = tmp_path / "heavy.urdf"
    heavy.write_text(heavier(tiny_request).urdf)
    before = snapshot(tiny)
    one = child(BUILD_AND_HANG, heavy, tiny.parent, stage, 600)
    assert one.stdout is not None
    assert one.stdout.readline() == "here\n"
    one.send_signal(signal.SIGKILL)
    one.communicate(timeout=60)
    assert snapshot(tiny) == before
    assert mass(tiny) == pytest.approx(1.5, rel=1e-14)
    assert build(heavier(tiny_request), tiny.parent).rebuilt
    assert mass(tiny) == pytest.approx(2.5, rel=1e-14)
    assert [path.name for path in tiny.parent.iterdir() if path.is_dir()] == ["tiny"]


# --- from the folder back to the request ----------------------------------------------------------


@pytest.mark.parametrize(
    ("file", "options", "config", "project"),
    [
        (None, ChainOptions(), RobotConfig(), False),
        ("tree.urdf", ChainOptions(), RobotConfig(), False),
        ("tree.urdf", ChainOptions(tip="camera"), RobotConfig(home=(0.5,)), True),
        (
            "tree.urdf",
            ChainOptions(locks={"trunk_turn": 0.3, "left_lift": -0.2}),
            RobotConfig(jerk=(9.0, 8.0)),
            False,
        ),
        ("gantry.urdf", ChainOptions(base="rail", tip="quill"), RobotConfig(), False),
        (
            "gantry.urdf",
            ChainOptions(base="carriage", gravity=(0.0, 9.81, 0.0), locks={"turn": 0.7}),
            RobotConfig(acceleration=(1.0, 2.0)),
            False,
        ),
    ],
)
def test_folder_regenerates_itself(
    tmp_path: Path, file: str | None, options: ChainOptions, config: RobotConfig, project: bool
) -> None:
    """Property: what a folder holds is enough to generate the same bytes again."""
    text = (DATA / file).read_text() if file else TINY_URDF
    robot, _ = generate(BuildRequest("own", text, options, config, project))
    folder = tmp_path / "own"
    folder.mkdir()
    for name, content in robot.files.items():
        (folder / name).write_text(content, encoding="utf-8")
    again, _ = generate(request_from_folder(folder))
    assert again.files == robot.files
    assert again.model_hash == robot.model_hash


def test_broken_folder_is_named(tiny: Path) -> None:
    """Property: a folder without its manifest or URDF says so."""
    (tiny / "tiny.urdf").unlink()
    with pytest.raises(BuildError, match=r"is not a complete generated folder .*symgen build"):
        request_from_folder(tiny)
    (tiny / "manifest.json").write_text("{}")
    with pytest.raises(BuildError, match="is not a complete generated folder"):
        request_from_folder(tiny)


# --- requests -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["My-Robot", "", "7dof", "a b", "../up", "größe", "a\n", "_x"])
def test_bad_names(name: str) -> None:
    """Property: a name that is no C prefix is refused before anything happens."""
    with pytest.raises(BuildError, match="expected lower-case letters, digits and _"):
        BuildRequest(name, TINY_URDF)


def test_unknown_bundled_robot() -> None:
    """Property: lists what there is."""
    with pytest.raises(BuildError, match=r"called 'r2d2' \(there is fr3, ur5e\)"):
        bundled_request("r2d2")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("colour = [1]", "unknown key 'colour'; known are home, acceleration, jerk"),
        ("home = 1", "home needs a list of finite numbers"),
        ("home = []", "home needs a list of finite numbers"),
        ("home = [nan]", "home needs a list of finite numbers"),
        ('jerk = ["fast"]', "jerk needs a list of finite numbers"),
        ("home = [", "cannot read the robot configuration"),
        ("home = [1.0, 2.0]", "gives 2 values for home, the chain has 1 joints: swing"),
    ],
)
def test_bad_configuration(tmp_path: Path, text: str, message: str) -> None:
    """Property: file, key and joints are named."""
    path = tmp_path / "robot.toml"
    path.write_text(text)
    with pytest.raises(SymgenError, match=message):
        generate(BuildRequest("tiny", TINY_URDF, config=read_config(path)))


def test_missing_configuration(tmp_path: Path) -> None:
    """Property: a configuration that is not there, or not text, is one sentence."""
    (tmp_path / "latin.toml").write_bytes(b"source = '\xe9'")
    for name in ("nowhere.toml", "latin.toml"):
        with pytest.raises(BuildError, match="cannot read the robot configuration"):
            read_config(tmp_path / name)


def test_notes_tell_what_was_done(tmp_path: Path) -> None:
    """Property: lumped, cut and projected bodies are reported to the user."""
    text = (DATA / "tree.urdf").read_text()
    options = ChainOptions(tip="left_arm")
    notes = generate(BuildRequest("t", text, options))[1]
    assert "link 'camera' (0.2 kg) is fixed and counts into 'trunk'" in notes
    assert "cut off by --base/--tip: left_hand, right_arm" in notes
    impossible = TINY_URDF.replace('izz="0.01"', 'izz="0.5"')
    notes = generate(BuildRequest("t", impossible, project=True))[1]
    assert any("the inertia of 'rod' cannot exist and was projected" in note for note in notes)


def test_rounded_angles_are_told() -> None:
    """Property: 3.1416 hides a right angle that --snap finds; 0.5 and π hide none."""
    tilted = TINY_URDF.replace('<origin xyz="0 0 0.5"/>', '<origin xyz="0 0 0.5" rpy="ANGLE 0 0"/>')
    assert tilted != TINY_URDF
    for angle, snap, is_told in (
        ("3.1416", 0.0, True),
        ("3.1416", 1e-4, False),
        ("3.141592653589793", 0.0, False),
        ("0.5", 0.0, False),
    ):
        chain = read_chain(tilted.replace("ANGLE", angle), ChainOptions(snap=snap))
        notes = symgen.build._notes(chain, {})
        assert (
            any("angles of swing" in note and "--snap 0.0001" in note for note in notes) == is_told
        )


def test_c_code_alone_is_enough(tiny_built: Path, tmp_path: Path) -> None:
    """Oracle: *.c and *.h copied elsewhere compile without this project and compute the same."""
    for name in ("kernels.c", "reference.c", "tiny.h"):
        shutil.copy(tiny_built / name, tmp_path)
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler on the PATH")
    command = [compiler, "-O2", "-shared", "-fPIC", "-o", "a.so", "kernels.c", "reference.c", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    pi0 = np.array(json.loads((tiny_built / "manifest.json").read_text())["pi0"])
    function = ctypes.CDLL(str(tmp_path / "a.so")).tiny_inverse_dynamics
    q, out = np.zeros(1), np.zeros(1)
    function(*(ctypes.c_void_p(a.ctypes.data) for a in (q, q, q, pi0, out)))
    assert out[0] == pytest.approx(-1.5 * 9.81 * 0.1, rel=1e-14)
