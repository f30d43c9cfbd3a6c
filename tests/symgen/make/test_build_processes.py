"""Doubled and killed builds: one builds, the others wait, nothing half made is left."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from symgen.make.request import BuildRequest
from tests.conftest import REPOSITORY
from tests.symgen.builds import heavier, mass, rebuild, snapshot

BUILD = """
import sys
from pathlib import Path
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.robots import ONE_LEVEL
request = BuildRequest("tiny", Path(sys.argv[1]).read_text())
build(request, Path(sys.argv[2]), force=True, levels=ONE_LEVEL)
"""
BUILD_AND_HANG = """
import sys, time
from pathlib import Path
import symgen.make.pipeline
from symgen.make.request import BuildRequest
from tests.robots import ONE_LEVEL
stage = getattr(symgen.make.pipeline, sys.argv[3])
def hang(*arguments):
    if sys.argv[3] != "replace_folder":
        stage(*arguments)
    print("here", flush=True)
    time.sleep(float(sys.argv[4]))
setattr(symgen.make.pipeline, sys.argv[3], hang)
request = BuildRequest("tiny", Path(sys.argv[1]).read_text())
symgen.make.pipeline.build(request, Path(sys.argv[2]), levels=ONE_LEVEL)
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
        _, complaint = one.communicate(timeout=300)
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
    assert rebuild(heavier(tiny_request), tiny.parent)
    _, complaint = first.communicate(timeout=300)
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
    assert not rebuild(heavier(tiny_request), tiny.parent)
    _, complaint = first.communicate(timeout=300)
    assert first.returncode == 0, complaint
    assert mass(tiny) == pytest.approx(2.5, rel=1e-14)


@pytest.mark.parametrize("stage", ["_write_files", "compile_library", "replace_folder"])
def test_killed_build(tiny: Path, tiny_request: BuildRequest, tmp_path: Path, stage: str) -> None:
    """Property: SIGKILL after any stage leaves the old library loadable and the next build free."""
    heavy = tmp_path / "heavy.urdf"
    heavy.write_text(heavier(tiny_request).urdf)
    before = snapshot(tiny)
    one = child(BUILD_AND_HANG, heavy, tiny.parent, stage, 600)
    assert one.stdout is not None
    assert one.stdout.readline() == "here\n"
    one.send_signal(signal.SIGKILL)
    one.communicate(timeout=300)
    assert snapshot(tiny) == before
    assert mass(tiny) == pytest.approx(1.5, rel=1e-14)
    assert rebuild(heavier(tiny_request), tiny.parent)
    assert mass(tiny) == pytest.approx(2.5, rel=1e-14)
    assert [path.name for path in tiny.parent.iterdir() if path.is_dir()] == ["tiny"]
