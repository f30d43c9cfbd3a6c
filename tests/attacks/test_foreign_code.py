"""No code of a folder runs unless the package holds it, this user built it, or it was typed.

A folder of an attacker holds a shared library beside a build.json that agrees with it; the library
writes a file when it is opened. Every test looks for that file.
"""

import ctypes
import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from runtime.common.compiler import find_compiler
from runtime.errors import LibraryError, RecordingError
from runtime.identification.saved_result import read_result
from runtime.library import Library, load
from runtime.library.library import ForeignRobotError
from symgen.make.pipeline import build, is_current
from symgen.make.request import BuildRequest, bundled_request
from tests.conftest import REPOSITORY
from tests.runtime.conftest import Command

RESULT = REPOSITORY / "tests" / "data" / "result_format_1.json"
EXAMPLE = REPOSITORY / "runtime" / "examples" / "fr3_simulated.npz"
NAMES = ("../evil/tiny", "/evil", "./tiny", "evil/tiny", "Tiny", "tiny/", "", ".", "~/tiny")


@pytest.fixture
def canary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """File that the attacker's library writes."""
    monkeypatch.setenv("CANARY", str(tmp_path / "owned"))
    return tmp_path / "owned"


@pytest.fixture(scope="module")
def evil(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The attacker's library: when it is opened it writes the file that $CANARY names."""
    source = tmp_path_factory.mktemp("evil") / "evil.c"
    source.write_text(
        "#include <stdio.h>\n#include <stdlib.h>\n"
        "__attribute__((constructor)) static void run(void)\n"
        '{ FILE *f = fopen(getenv("CANARY"), "w"); if (f) fclose(f); }\n'
    )
    library = source.with_suffix(".so")
    subprocess.run([*find_compiler(), "-shared", "-fPIC", source, "-o", library], check=True)
    return library


@pytest.fixture
def forge(evil: Path, canary: Path) -> Callable[[Path], Path]:
    """Replaces the library of a generated folder by the attacker's, and makes its record agree."""

    def forged(folder: Path) -> Path:
        (library,) = folder.glob("lib*.so")
        library.unlink()
        shutil.copy(evil, library)
        record = json.loads((folder / "build.json").read_text())
        record["sha256"] = hashlib.sha256(library.read_bytes()).hexdigest()
        (folder / "build.json").write_text(json.dumps(record))
        return folder

    return forged


@pytest.fixture
def one_level(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A compilation at first use takes a second, in a cache of its own."""
    monkeypatch.setenv("SYMGEN_LEVELS", "portable")
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("command_name", ["evaluate", "export"])
def test_a_result_chooses_no_folder(
    command_name: str,
    name: str,
    tiny: Path,
    forge: Callable[[Path], Path],
    canary: Path,
    command: Command,
    tmp_path: Path,
) -> None:
    """Property: `robot` of a result.json is a name; a path in it is refused, and nothing runs."""
    shutil.copytree(forge(tiny), tmp_path / "evil" / "tiny")
    facts = json.loads(RESULT.read_text()) | {"robot": name}
    (tmp_path / "result.json").write_text(json.dumps(facts))
    with pytest.raises(RecordingError, match="expected the name of a robot"):
        read_result(tmp_path)
    words = (tmp_path, EXAMPLE) if command_name == "evaluate" else (tmp_path,)
    ran = command(command_name, *words)
    assert ran.code == 2
    assert "expected the name of a robot" in ran.err
    assert not canary.exists()


def test_the_attack_works(evil: Path, canary: Path) -> None:
    """Property: the library of the tests below does write the file when somebody opens it."""
    ctypes.CDLL(str(evil))
    assert canary.exists()


@pytest.mark.usefixtures("one_level")
def test_a_library_of_someone_else_is_never_opened(
    tiny: Path, forge: Callable[[Path], Path], canary: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Property: even by its path the folder's C code is compiled and its library left alone."""
    lib = load(forge(tiny))
    assert lib.name == "tiny"
    assert not canary.exists()
    assert "compiling the C code of 'tiny'" in capfd.readouterr().err


def test_a_library_that_others_can_write_is_not_opened(
    tiny: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Property: between the check and the opening another user could replace the file."""
    monkeypatch.setenv("SYMGEN_LEVELS", "portable")
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))
    (tiny / "libtiny.so").chmod(0o777)
    load(tiny)
    assert "compiling the C code of 'tiny'" in capfd.readouterr().err


def test_a_name_prefers_the_package(
    tiny: Path,
    forge: Callable[[Path], Path],
    canary: Path,
    command: Command,
    tmp_path: Path,
    fr3: Library,
) -> None:
    """Property: `--robot fr3` in a downloaded folder is the package's, and the command says so."""
    shutil.copytree(forge(tiny), tmp_path / "generated" / "fr3")
    (tmp_path / "fr3").mkdir()  # a folder of this name was once taken for a path
    ran = command("inspect", EXAMPLE)
    assert ran.code in {0, 1}
    assert f"robot 'fr3' of the package: {REPOSITORY / 'generated' / 'fr3'}" in ran.err
    assert not canary.exists()


@pytest.mark.usefixtures("one_level")
def test_the_working_directory_needs_consent(
    tiny: Path,
    forge: Callable[[Path], Path],
    canary: Path,
    command: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Property: a robot that only ./generated holds is refused by name, and runs with --settings
    yes=true.
    """
    folder = tmp_path / "generated" / "stranger"
    text = (tiny / "tiny.urdf").read_text()
    build(BuildRequest("stranger", text), tmp_path / "generated", levels=("portable",))
    record = Path(f"{hashlib.sha256((folder / 'libstranger.so').read_bytes()).hexdigest()}.json")
    monkeypatch.chdir(tmp_path)
    assert load("stranger").folder == Path("generated/stranger")
    forge(folder)
    # The user's own build of that name was of this folder, whose library is now another.
    monkeypatch.setenv("SYMGEN_BUILDS", str(tmp_path / "no-builds"))
    assert not (tmp_path / "no-builds" / record).exists()
    with pytest.raises(
        ForeignRobotError, match=r"built by you, .*--robot .*stranger or --settings yes=true"
    ):
        load("stranger")
    refused = command("simulate", "--robot", "stranger")
    assert (refused.code, refused.out) == (2, "")
    assert "generated/stranger" in refused.err
    words = (
        "simulate",
        "--robot",
        "stranger",
        "--settings",
        "yes=true",
        "--out",
        "s.csv",
        "--ideal",
    )
    agreed = command(*words, "--settings", "torque_noise=-1")
    assert "robot 'stranger' of the working directory: generated/stranger" in agreed.err
    assert not canary.exists()


def test_own_builds_are_found_from_anywhere(
    tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a robot that the user built is loaded by name in any folder."""
    text = (tiny / "tiny.urdf").read_text()
    build(BuildRequest("stranger", text), tmp_path / "project", levels=("portable",))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert load("stranger").folder == tmp_path / "project" / "stranger"
    with pytest.raises(LibraryError, match="no generated robot is called 'yours'"):
        load("yours")


def test_a_record_that_others_can_write_does_not_count(
    tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: records in a folder that everybody may write make no library trusted."""
    monkeypatch.setenv("SYMGEN_BUILDS", str(tmp_path / "records"))
    text = (tiny / "tiny.urdf").read_text()
    build(BuildRequest("stranger", text), tmp_path / "project", levels=("portable",))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert load("stranger").name == "stranger"
    (tmp_path / "records").chmod(0o777)
    with pytest.raises(LibraryError, match="no generated robot"):
        load("stranger")


def test_build_replaces_a_foreign_library(
    tiny: Path, forge: Callable[[Path], Path], tiny_request: BuildRequest, canary: Path
) -> None:
    """Property: "up to date" is said of own builds only, whatever build.json states."""
    assert is_current(tiny_request, tiny)
    forge(tiny)
    assert not is_current(tiny_request, tiny)
    assert build(tiny_request, tiny.parent).rebuilt
    load(tiny)
    assert not canary.exists()


def test_the_lock_of_a_build_follows_no_link(tmp_path: Path, tiny_request: BuildRequest) -> None:
    """Property: a link in the place of the lock does not empty the file that it points to."""
    precious = tmp_path / "precious"
    precious.write_text("mine")
    (tmp_path / "generated").mkdir()
    (tmp_path / "generated" / ".tiny.lock").symlink_to(precious)
    with pytest.raises(Exception, match="cannot write"):
        build(tiny_request, tmp_path / "generated")
    assert precious.read_text() == "mine"


@pytest.mark.parametrize("module", ["symgen", "runtime"])
def test_modules_of_the_working_directory_are_not_imported(module: str, tmp_path: Path) -> None:
    """Property: `python -m` puts the working directory first on the path; both programs drop it."""
    for name in ("numpy", "typer", "json", "scipy"):
        (tmp_path / f"{name}.py").write_text("open('owned', 'w').close()\n")
    ran = subprocess.run(
        [sys.executable, "-m", module, "--help"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert not (tmp_path / "owned").exists(), ran.stderr
    assert ran.returncode == 0, ran.stderr


def test_workers_import_nothing_of_the_working_directory(tiny: Path, tmp_path: Path) -> None:
    """Property: a worker and the tracker of semaphores begin as `python -c` in that directory."""
    for name in ("pickle", "runpy", "socket", "signal", "tempfile", "struct"):
        (tmp_path / f"{name}.py").write_text(f"open('owned-{name}', 'w').close()\n")
    words = (
        "excite",
        "--robot",
        tiny,
        "--duration",
        "2",
        "--settings",
        "harmonics=2",
        "--settings",
        "document=true",
    )
    ran = subprocess.run(
        [
            sys.executable,
            "-m",
            "runtime",
            *words,
            "--settings",
            "starts=2",
            "--settings",
            "processes=2",
        ],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert not list(tmp_path.glob("owned*")), ran.stderr
    assert ran.returncode == 0, ran.stderr


def test_bundled_names_are_names() -> None:
    """Property: what the package ships can be loaded by name."""
    assert bundled_request("fr3").name == "fr3"
