"""Libraries compiled at first use: from anywhere, once, whole, and nothing but compiled."""

import ctypes
import errno
import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import platformdirs
import pytest

from runtime.errors import LibraryError
from runtime.library import compile_cache, load
from runtime.library.compile_cache import compiled_library
from symgen.make.compiler import how_to_compile
from tests.conftest import REPOSITORY

LEVEL_C = "#define JOIN(x) toy_##x\n#define AT(x) JOIN(x)\nint AT(LEVEL)(void) { return W; }\n"


@pytest.fixture
def toy(tmp_path: Path) -> Path:
    """A generated folder that is quickly compiled: y = 2 x, a function per level, a reference."""
    folder = tmp_path / "toy"
    folder.mkdir()
    files = {
        "kernels.c": "double toy_twice(double x) { return 2.0 * x; }\n",
        "tiles.c": LEVEL_C,
        "reference.c": "int toy_casadi(void) { return 0; }\n",
        "manifest.json": "{}",
    }
    for name, text in files.items():
        (folder / name).write_text(text)
    digests = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in files.items()}
    how = how_to_compile(["kernels.c"], ["tiles.c"], ["reference.c"])
    (folder / "compile.json").write_text(json.dumps({"files": digests, **how}))
    return folder


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache folder; one level, to be quick."""
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("SYMGEN_LEVELS", "portable")
    return tmp_path / "cache"


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Takes the compilers away when asked for."""
    (tmp_path / "empty").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "empty"))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)


def libraries(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.suffix == ".so")


def works(place: Path) -> bool:
    """The library computes, from a copy: the loader remembers what a path held."""
    with tempfile.TemporaryDirectory() as fresh:
        function = ctypes.CDLL(shutil.copy(place / "libtoy.so", fresh)).toy_twice
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double]
    return function(21.0) == 42.0


def levels_in(place: Path) -> set[str]:
    library = ctypes.CDLL(str(place / "libtoy.so"))
    return {name for name in ("v4", "portable", "casadi") if hasattr(library, f"toy_{name}")}


def test_first_use_of_a_robot(tiny: Path, kept: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Oracle: m g of the pendulum; property: one line on stderr, the folder is not written."""
    (tiny / "libtiny.so").unlink()
    (tiny / "build.json").unlink()
    before = sorted(tiny.iterdir())
    lib = load(tiny)
    assert lib.levels == ("portable",)
    torque = lib.inverse_dynamics([0.0], [0.0], [0.0], lib.pi0)
    assert torque[0] == pytest.approx(-1.5 * 9.81 * 0.1, rel=1e-14)  # an arm of 0.1 m
    out, err = capfd.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "compiling the C code of 'tiny' once" in err
    assert str(kept) in err
    load(tiny, "portable")
    assert capfd.readouterr().err == ""
    assert sorted(tiny.iterdir()) == before


def test_compiled_once(toy: Path, kept: Path) -> None:
    """Property: library and record come alone, and are not touched the second time."""
    place = compiled_library(toy, "toy")
    assert works(place)
    assert sorted(path.name for path in place.iterdir()) == ["build.json", "libtoy.so"]
    written = (place / "libtoy.so").stat().st_mtime_ns
    assert compiled_library(toy, "toy") == place
    assert (place / "libtoy.so").stat().st_mtime_ns == written


def test_levels(toy: Path, kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: those of the environment and the one asked for; by default all but casadi."""
    assert levels_in(compiled_library(toy, "toy")) == {"portable"}
    assert levels_in(compiled_library(toy, "toy", "casadi")) == {"portable", "casadi"}
    assert len(libraries(kept)) == 2
    with pytest.raises(LibraryError, match=r"no level 'v9' on .*has .*portable.*SYMGEN_LEVELS"):
        compiled_library(toy, "toy", "v9")
    monkeypatch.delenv("SYMGEN_LEVELS")
    assert levels_in(compiled_library(toy, "toy")) >= {"portable"}
    assert "casadi" not in levels_in(compiled_library(toy, "toy"))


def test_a_damaged_entry_is_made_again(toy: Path, kept: Path) -> None:
    """Property: neither a truncated library nor a truncated record reaches the loader."""
    place = compiled_library(toy, "toy")
    for name in ("libtoy.so", "build.json"):
        os.truncate(place / name, 100)
        assert works(compiled_library(toy, "toy"))


def test_a_cache_outlives_its_compiler(
    toy: Path, kept: Path, request: pytest.FixtureRequest
) -> None:
    """Property: what is in the cache needs no compiler; what is not says how to get one."""
    place = compiled_library(toy, "toy")
    request.getfixturevalue("no_compiler")
    assert compiled_library(toy, "toy") == place
    shutil.rmtree(kept)
    with pytest.raises(LibraryError, match=r"no C compiler .* pip install 'symgen\[zig\]'"):
        compiled_library(toy, "toy")


def test_a_wrong_cc_is_named(toy: Path, kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: never replaced in silence; one that fails is quoted and leaves nothing."""
    monkeypatch.setenv("CC", "no-such-cc")
    with pytest.raises(LibraryError, match=r"\$CC names the compiler 'no-such-cc'"):
        compiled_library(toy, "toy")
    monkeypatch.setenv("CC", "false")
    with pytest.raises(LibraryError, match=r"'false -std=c99 .*' failed"):
        compiled_library(toy, "toy")
    assert not [path for path in kept.glob("*/*") if path.name != ".lock"]


TWO = """
import sys
from pathlib import Path
from runtime.library.compile_cache import compiled_library
print(compiled_library(Path(sys.argv[1]), "toy"))
"""


def test_two_processes_at_once(toy: Path, kept: Path) -> None:
    """Property: both get the library; it was compiled once."""
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    children = [
        subprocess.Popen(
            [sys.executable, "-c", TWO, toy],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    said = [child.communicate(timeout=300) for child in children]
    assert [child.returncode for child in children] == [0, 0], said
    assert works(Path(said[0][0].strip()))
    assert sum(err.count("compiling") for _, err in said) == 1
    assert len(libraries(kept)) == 1


def test_places_that_cannot_be_written(
    toy: Path,
    kept: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Property: a chosen cache is not replaced; for the usual one a private folder serves."""
    wall = tmp_path / "wall"
    wall.write_text("a file where a folder should be")
    monkeypatch.setenv("SYMGEN_CACHE", str(wall / "cache"))
    with pytest.raises(LibraryError, match=r"wall.cache' cannot be written .*SYMGEN_CACHE"):
        compiled_library(toy, "toy")
    monkeypatch.delenv("SYMGEN_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(wall))
    monkeypatch.setattr(platformdirs, "user_cache_path", lambda name: wall / name)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    single = tmp_path / f"symgen-{os.getuid()}"
    assert works(compiled_library(toy, "toy"))
    assert f"so {single} serves; to keep it, set SYMGEN_CACHE" in capfd.readouterr().err
    assert single.stat().st_mode & 0o077 == 0
    compiled_library(toy, "toy")
    assert capfd.readouterr().err == ""
    single.chmod(0o777)  # anybody may have put a library there
    compiled_library(toy, "toy")
    assert str(single) + " " not in capfd.readouterr().err
    assert len(libraries(tmp_path)) == 2


def test_a_full_disk_leaves_nothing(toy: Path, kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: ENOSPC is one sentence, and no half entry remains."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(compile_cache, "compile_folder", full)
    with pytest.raises(LibraryError, match="No space left on device"):
        compiled_library(toy, "toy")
    assert not [path for path in kept.glob("*/*") if path.name != ".lock"]


def test_old_libraries_are_deleted(
    toy: Path, kept: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Property: the newest three stay, so does what was used within a month, so do other robots."""
    now = time.time()

    def made(key: str, days: float) -> Path:
        entry = kept / key / "01234567"
        entry.mkdir(parents=True)
        (entry / "libtoy.so").write_text("")
        (entry / "build.json").write_text("{}")
        os.utime(entry / "build.json", (now - days * 86400, now - days * 86400))
        return entry

    recent = [made(f"toy-{k:016x}", days) for k, days in enumerate((1, 20, 29))]
    old = [made(f"toy-{k:016x}", days) for k, days in enumerate((31, 400), 8)]
    other = [made(f"toys-{k:016x}", 400) for k in range(5)]
    place = compiled_library(toy, "toy")
    assert "deleted 2 compiled libraries of 'toy'" in capfd.readouterr().err
    assert works(place)
    assert all(entry.exists() for entry in (*recent, *other))
    assert not any(entry.exists() for entry in old)
    # Three stay however old, and a use makes an entry the newest.
    for entry in (place, *recent):
        os.utime(entry / "build.json", (now - 9e6, now - 9e6))
    assert compiled_library(toy, "toy") == place
    assert len(compile_cache.prune(kept, "toy")) == 1
    assert works(place)
    assert compile_cache.prune(kept, "toy") == []


def test_changed_sources_are_not_compiled(toy: Path, kept: Path) -> None:
    """Property: a file that is not the generated one is named; none is compiled in its place."""
    path = toy / "kernels.c"
    path.write_text(path.read_text() + "\n")
    with pytest.raises(LibraryError, match=r"kernels\.c' is not the file that was generated"):
        compiled_library(toy, "toy")
    path.unlink()
    with pytest.raises(LibraryError, match=r"kernels\.c' cannot be read"):
        compiled_library(toy, "toy")
    assert not libraries(kept)


@pytest.mark.parametrize(
    "change",
    [
        lambda raw: raw["flags"].append("-fplugin=evil.so"),
        lambda raw: raw["flags"].append("@arguments"),
        lambda raw: raw["link"].append("-Wl,-rpath=/tmp"),
        lambda raw: raw["link"].append(3),
        lambda raw: raw["groups"][0]["flags"].append("-I/etc"),
        lambda raw: raw["groups"][0]["flags"].append("-o"),
        lambda raw: raw["groups"][0]["gcc"].append("-fno-such-pass"),
        lambda raw: raw["groups"][0].pop("gcc"),
        lambda raw: raw["groups"][0]["sources"].append("../evil.c"),
        lambda raw: raw["groups"][0]["sources"].append("-E.c"),
        lambda raw: raw["groups"][0]["sources"].append("evil.c"),
        lambda raw: raw["groups"][0]["sources"].append("manifest.json"),
        lambda raw: raw["groups"][0].update(level="../v3"),
        lambda raw: raw["groups"][0].update(sources="kernels.c"),
        lambda raw: raw["files"].update({"../../etc/passwd.c": "0"}),
        lambda raw: raw.pop("groups"),
        lambda raw: raw.update(groups={}),
        lambda raw: raw.update(files=[]),
    ],
)
def test_a_recipe_is_data(toy: Path, kept: Path, change: object) -> None:
    """Property: whatever it asks for beyond its own files and known flags is refused."""
    raw = json.loads((toy / "compile.json").read_text())
    change(raw)
    (toy / "compile.json").write_text(json.dumps(raw))
    with pytest.raises(LibraryError, match=r"compile\.json' is damaged"):
        compiled_library(toy, "toy")
    assert not kept.exists()
