"""`python -m symgen`: sentences, exit codes, and no trace of a refused build."""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from runtime.cli.common import robots as complete_robot
from runtime.common.user_builds import DEFAULT_ROOT, generated_here, record_build
from runtime.library import Library
from symgen.cli import main
from tests.conftest import REPOSITORY, TINY_URDF
from tests.robots import ONE_LEVEL
from tests.symgen.builds import snapshot
from tests.symgen.test_chain_refusals import MALFORMED

QUICKLY = ("--settings", f"level={ONE_LEVEL[0]}")


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of the command line."""
    argv, sys.argv = sys.argv, ["symgen", *map(str, arguments)]
    try:
        main()
        code = 0
    except SystemExit as done:
        code = int(done.code or 0)
    finally:
        sys.argv = argv
    out, err = capsys.readouterr()
    return code, out, err


def refuses(capsys: pytest.CaptureFixture[str], out: Path, *arguments: object) -> str:
    """The one sentence of a refused command that changed no file below `out`."""
    before = snapshot(out)
    code, said, sentence = run(capsys, *arguments, "--out", out)
    assert code == 2
    assert said.strip() == ""
    assert sentence.startswith("symgen: ")
    assert "Traceback" not in sentence
    assert sentence.count("\n") == 1
    assert snapshot(out) == before
    assert [path.name for path in out.iterdir() if path.is_dir()] == ["tiny"]
    return sentence


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    path = tmp_path / "own.urdf"
    path.write_text(TINY_URDF)
    return path


@pytest.mark.parametrize("name", sorted(MALFORMED.keys() - {"no-inertial", "two-roots"}))
def test_malformed_urdf(
    name: str, tiny: Path, urdf: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: exit 2, one sentence, no traceback, no file changed."""
    text, message = MALFORMED[name]
    urdf.write_text(text)
    for robot in ("own", "tiny"):
        sentence = refuses(capsys, tiny.parent, "build", "--urdf", urdf, "--name", robot)
        assert re.search(message, sentence)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--tip", "hand"], "--tip names the link 'hand'"),
        (["--base", "roof"], "--base names the link 'roof'"),
        (["--lock", "elbow=1"], "--lock names the joint 'elbow'"),
        (["--lock", "swing=down"], "--lock needs JOINT=VALUE with a number, got 'swing=down'"),
        (["--lock", "swing"], "--lock needs JOINT=VALUE"),
        (["--lock", "swing=nan"], "expected a finite value"),
        (["--lock", "swing=1"], "no joint of this URDF moves"),
        (["--gravity", "down"], "--gravity needs three numbers X,Y,Z, got 'down'"),
        (["--gravity", "1,2"], "--gravity needs three numbers"),
        (["--gravity", "0,0,nan"], "--gravity needs three finite numbers"),
        (["--settings", "snap=3"], "the setting snap needs an angle between 0 and 0.1 rad"),
        (["--name", "My-Robot"], "expected lower-case letters, digits and _, got 'My-Robot'"),
        (["--name", "fr3"], "'fr3' is the name of a bundled robot"),
        (
            ["--config", "nowhere.toml"],
            "'nowhere.toml' cannot be read as TOML (No such file or directory)",
        ),
    ],
)
def test_bad_options(
    arguments: list[str], message: str, tiny: Path, urdf: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: exit 2, and the sentence names the option and the value."""
    name = [] if "--name" in arguments else ["--name", "own"]
    sentence = refuses(capsys, tiny.parent, "build", "--urdf", urdf, *name, *arguments)
    assert message in sentence


def test_bad_files(tiny: Path, urdf: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: files that are missing, not text, or impossible are named."""
    build = ("build", "--urdf", urdf, "--name", "own")
    urdf.write_bytes(b"<robot name='caf\xe9'/>")
    assert "is not UTF-8 text" in refuses(capsys, tiny.parent, *build)
    urdf.write_text(TINY_URDF.replace('izz="0.01"', 'izz="0.5"'))
    assert "--settings project=true" in refuses(capsys, tiny.parent, *build)
    urdf.unlink()
    assert "cannot read the URDF" in refuses(capsys, tiny.parent, *build)
    config = urdf.with_suffix(".toml")
    urdf.write_text(TINY_URDF)
    for text, message in {
        "home = [1.0, 2.0]": "gives 2 values for home, the chain has 1 joints: swing",
        "colour = [1]": "unknown key 'colour'",
    }.items():
        config.write_text(text)
        assert message in refuses(capsys, tiny.parent, *build, "--config", config)


def test_options_without_urdf(tiny: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: options of an own robot are not silently dropped for a bundled one."""
    for arguments in (["--tip", "x"], ["--gravity", "0,0,1"]):
        assert "needs a --name" in refuses(capsys, tiny.parent, "build", *arguments)
    for arguments in (
        ["--settings", "project=true"],
        ["--name", "x", "--settings", "project=true"],
    ):
        assert "give its --urdf too" in refuses(capsys, tiny.parent, "build", *arguments)
    assert "no bundled robot is called" in refuses(capsys, tiny.parent, "build", "--robot", "r2")


def test_urdf_without_name(tiny: Path, urdf: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: says what the name is for."""
    said = refuses(capsys, tiny.parent, "build", "--urdf", urdf)
    assert "--urdf needs --name" in said
    assert said.rstrip().endswith(f"such as {urdf.stem}")


def test_one_refusal_in_a_real_process(tmp_path: Path, urdf: Path) -> None:
    """Property: `python -m symgen build` of a bad file: exit 2, one sentence on stderr."""
    urdf.write_text(MALFORMED["entity-bomb"][0])
    command = [sys.executable, "-m", "symgen", "build", "--urdf", str(urdf), "--name", "own"]
    done = subprocess.run(
        [*command, "--out", str(tmp_path / "out")],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("symgen: the URDF declares a DTD")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out" / "own").exists()


# --- the good paths ---------------------------------------------------------------------------


def test_build_says_what_happened(
    tmp_path: Path, urdf: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: built, then up to date, and rebuilt when forced."""
    own = ("--urdf", urdf, "--name", "own", "--base", "base")  # a stated base needs no note
    build = ("build", *own, "--gravity", "0,0,-1.62", *QUICKLY)
    for extra, state in (
        ((), "built"),
        ((), "up to date"),
        (("--settings", "force=true"), "built"),
    ):
        code, out, _ = run(capsys, *build, *extra, "--out", tmp_path / "out")
        assert (code, out.strip()) == (0, f"{tmp_path / 'out' / 'own'}: {state}")
    manifest = json.loads((tmp_path / "out" / "own" / "manifest.json").read_text())
    assert manifest["gravity"] == [0.0, 0.0, -1.62]


def test_build_notes(tmp_path: Path, urdf: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: a projection is never silent."""
    urdf.write_text(TINY_URDF.replace('izz="0.01"', 'izz="0.5"'))
    build = ("build", "--urdf", urdf, "--name", "own", "--settings", "project=true", *QUICKLY)
    code, out, _ = run(capsys, *build, "--out", tmp_path / "out")
    assert code == 0
    assert "note: the inertia of 'rod' is not physically consistent and was projected" in out


def test_check(tiny: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: 0 and 'in sync'; after an edit 1 and a unified diff; nothing is written."""
    assert run(capsys, "check", "tiny", "--out", tiny.parent)[:2] == (0, f"{tiny}: in sync\n")
    header = tiny / "tiny.h"
    header.write_text(header.read_text().replace("row-major", "column-major"))
    before = snapshot(tiny)
    code, out, _ = run(capsys, "check", "--out", tiny.parent)
    assert code == 1
    assert "column-major" in out
    assert "+++ regenerated" in out
    assert "differs, run: symgen build" in out
    assert snapshot(tiny) == before
    (tiny / "kernels.c").unlink()
    assert run(capsys, "check", "--out", tiny.parent)[0] == 1


def test_check_names_each_robot(tiny: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: one robot's difference is not another's."""
    (tiny / "tiny.h").write_text("")
    second = tiny.parent / "stranger"
    build = ("build", "--urdf", tiny / "tiny.urdf", "--name", "stranger", *QUICKLY)
    run(capsys, *build, "--out", tiny.parent)
    code, out, _ = run(capsys, "check", "--out", tiny.parent)
    assert code == 1
    assert f"{tiny}: differs" in out
    assert f"{second}: in sync" in out


def test_list(tiny: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: bundled and generated robots, with the state of the library."""
    code, out, _ = run(capsys, "list", "--out", tiny.parent)
    rows = {line.split("│")[1].strip(): line for line in out.splitlines() if "│" in line}
    assert code == 0
    assert "yes" in rows["fr3"]
    assert "yes" in rows["ur5e"]
    assert "built" in rows["tiny"]
    (tiny / "libtiny.so").unlink()
    assert "not compiled" in run(capsys, "list", "--out", tiny.parent)[1]


def test_describe(tiny: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: the JSON holds joints, base combinations and kernels; the tables print."""
    code, out, _ = run(capsys, "describe", "tiny", "--json", "--out", tiny.parent)
    facts = json.loads(out)
    assert code == 0
    assert [joint["name"] for joint in facts["joints"]] == ["swing"]
    assert facts["base_parameters"] == ["rod.mX", "rod.mZ", "rod.YY"]
    assert {"inverse_dynamics", "lam_from_pi"} <= {kernel["name"] for kernel in facts["kernels"]}
    code, out, _ = run(capsys, "describe", "tiny", "--out", tiny.parent)
    assert code == 0
    assert "swing" in out
    assert "3 base parameters" in out
    assert run(capsys, "describe", "r2d2", "--out", tiny.parent)[0] == 2


def test_describe_regroups_readably(fr3: Library, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: b_1 of the FR3 is ZZ of link 1 with YY of link 2 added."""
    _, out, _ = run(capsys, "describe", "fr3", "--json", "--out", fr3.folder.parent)
    first = json.loads(out)["base_parameters"][0]
    assert first.startswith("fr3_link1.ZZ + fr3_link2.YY")


def test_clean(tiny: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: the folder of an own robot is deleted, and nothing else."""
    (tiny.parent / "keep").mkdir()
    code, _, sentence = run(capsys, "clean", "nobody", "--out", tiny.parent)
    assert code == 2
    assert "contains no generated robot" in sentence
    assert run(capsys, "clean", "tiny", "--out", tiny.parent)[0] == 0
    assert [path.name for path in tiny.parent.iterdir()] == ["keep"]


def test_clean_keeps_the_reviewed_files_of_bundled_robots(
    fr3: Library, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: of a bundled robot only the library and its record go."""
    folder = tmp_path / "fr3"
    folder.mkdir()
    for path in fr3.folder.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    before = {path.name for path in folder.iterdir()}
    assert run(capsys, "clean", "--out", tmp_path)[0] == 0
    assert before - {path.name for path in folder.iterdir()} == {"libfr3.so", "build.json"}


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[: len(text) // 2],
        lambda text: "[]",
        lambda text: "[" * 100000,
        lambda text: text.replace('"matrix"', '"matrices"', 1),
        lambda text: text.replace('"joints": [', '"joints": [7, ', 1),
        lambda text: text.replace('"pi_names": [', '"pi_names": 3, "more": [', 1),
        lambda text: text.replace('"kernels": [', '"kernels": [null, ', 1),
        lambda text: text.replace('"lower": ', f'"lower": {"9" * 400}, "lowest": ', 1),
    ],
    ids=["cut short", "a list", "deep", "no matrix", "a number", "no names", "null", "huge"],
)
def test_describe_refuses_a_damaged_manifest(
    damage: Callable[[str], str], tiny: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: one sentence, exit code 2, nothing printed and nothing changed."""
    path = tiny / "manifest.json"
    text = path.read_text()
    path.write_text(damage(text))
    assert path.read_text() != text
    for words in ((), ("--json",)):
        sentence = refuses(capsys, tiny.parent, "describe", "tiny", *words)
        assert "is damaged" in sentence
        assert "build the robot again with: symgen build" in sentence


def test_describe_prints_names_as_they_are(tiny: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Property: what the console takes for markup is a name all the same."""
    path = tiny / "manifest.json"
    path.write_text(path.read_text().replace('"name": "swing"', '"name": "[/swing]"'))
    code, said, _ = run(capsys, "describe", "tiny", "--out", tiny.parent)
    assert (code, "[/swing]" in said) == (0, True)


def test_every_build_of_the_user_is_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tiny: Path
) -> None:
    """Property: `list`, `describe` and completion know a robot that was built in another folder."""
    monkeypatch.setenv("SYMGEN_BUILDS", str(tmp_path / "builds"))
    monkeypatch.chdir(tmp_path)
    assert "tiny" not in [folder.name for folder in generated_here(DEFAULT_ROOT)]
    assert record_build("tiny", tiny, "0" * 64) == ""
    assert tiny.resolve() in generated_here(DEFAULT_ROOT)
    assert tiny.resolve() not in generated_here(tmp_path)
    assert complete_robot("ti") == ["tiny"]
