"""Objects that builds share: the same content is compiled once, for all robots of a user."""

import ctypes
import errno
import os
import shutil
import time
from pathlib import Path

import pytest

from symgen.build.compile_recipe import how_to_compile
from symgen.build.compiler import Compilation, find_compiler
from symgen.build.objects import DRAFT_S, UNUSED_S, Objects
from symgen.errors import CompilerError

SOURCE = """/* {name}, model {model} */
#include "{name}.h"

#if defined(__ARM_FEATURE_FMA)
/* a macro of the compiler, not of the robot "arm" */
#endif

const char *{name}_model_hash(void)
{{
    return "{model}";
}}

double {name}_scaled(double x)
{{
    return {NAME}_FACTOR * x;
}}
"""


class Desk:
    """A folder of objects, and a compiler that counts its compilations."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.objects, self._log = folder, folder / "objects", folder / "calls"
        wrapper = folder / "counting-cc"
        real = shutil.which("gcc") or pytest.skip("gcc is not on the PATH")
        wrapper.write_text(
            f'#!/bin/sh\ncase "$*" in *" -c "*) echo >> {self._log};; esac\nexec {real} "$@"\n'
        )
        wrapper.chmod(0o755)
        monkeypatch.setenv("CC", str(wrapper))
        monkeypatch.setenv("SYMGEN_OBJECTS", str(self.objects))

    def calls(self) -> int:
        """Compilations so far."""
        return len(self._log.read_text().splitlines()) if self._log.exists() else 0

    def build(self, name: str, model: str = "0" * 64, factor: str = "2.0", text: str = SOURCE):
        """The library of a robot."""
        place = self.folder / f"{name}{self.calls()}{time.monotonic_ns()}"
        place.mkdir()
        (place / "kernels.c").write_text(text.format(name=name, NAME=name.upper(), model=model))
        (place / f"{name}.h").write_text(f"#define {name.upper()}_FACTOR {factor}\n")
        objects = Objects(name, find_compiler())
        with Compilation(place, how_to_compile(["kernels.c"]), (), objects) as compilation:
            compilation.finish(["kernels.c"], place / "lib.so")
        library = ctypes.CDLL(str(place / "lib.so"))
        function, known = library[f"{name}_scaled"], library[f"{name}_model_hash"]
        function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double]
        known.restype = ctypes.c_char_p
        return function(3.0), known().decode()


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Desk:
    return Desk(tmp_path, monkeypatch)


def test_what_did_not_change_is_not_compiled_again(desk: Desk) -> None:
    """Property: another model or name compiles nothing; another header or text does."""
    assert desk.build("arm") == (6.0, "0" * 64)
    assert desk.build("arm", "1" * 64) == (6.0, "1" * 64)
    assert desk.calls() == 1
    if shutil.which("objcopy") and shutil.which("nm"):
        assert desk.build("longer_arm", "2" * 64) == (6.0, "2" * 64)
        assert desk.calls() == 1
    before = desk.calls()
    assert desk.build("arm", factor="5.0") == (15.0, "0" * 64)
    assert desk.build("arm", text=SOURCE.replace("* x", "/ x"))[0] == pytest.approx(2 / 3)
    assert desk.calls() == before + 2


def test_a_name_in_a_literal_is_not_shared(desk: Desk) -> None:
    """Property: a string keeps the name of its robot, which no table of symbols lists."""
    text = SOURCE + '\nconst char *{name}_called(void)\n{{\n    return "{name}";\n}}\n'
    desk.build("arm", text=text)
    desk.build("leg", text=text)
    assert desk.calls() == 2


def test_objects_that_are_damaged_or_open_to_others_do_not_count(desk: Desk) -> None:
    """Property: they are compiled again and replaced."""
    desk.build("arm")
    (entry,) = desk.objects.glob("*.o")
    assert entry.stat().st_mode & 0o077 == 0
    whole = entry.read_bytes()
    entry.write_bytes(whole[:-1])
    assert desk.build("arm")[0] == 6.0
    assert entry.read_bytes() == whole
    entry.chmod(0o666)
    desk.build("arm")
    assert desk.calls() == 3


def test_a_folder_that_others_can_write_is_refused(desk: Desk) -> None:
    """Property: one sentence with the folder and what to do."""
    desk.objects.mkdir()
    desk.objects.chmod(0o777)
    with pytest.raises(CompilerError, match=r"^expected SYMGEN_OBJECTS .*objects'.*chmod go-w"):
        desk.build("arm")


def test_off_keeps_nothing_and_old_objects_go(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: SYMGEN_OBJECTS=off compiles all; what no build used for a month is deleted."""
    desk.build("arm")
    (entry,) = desk.objects.glob("*.o")
    Objects("arm", find_compiler()).prune()
    assert entry.exists()
    past = time.time() - UNUSED_S - 60
    os.utime(entry, (past, past))
    Objects("arm", find_compiler()).prune()
    assert not entry.exists()
    monkeypatch.setenv("SYMGEN_OBJECTS", "off")
    desk.build("arm")
    desk.build("arm")
    assert desk.calls() == 3
    assert not list(desk.objects.glob("*.o"))


def test_a_file_in_place_of_the_folder(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: a named file is refused before the compiler starts; the usual one is left alone."""
    desk.objects.parent.mkdir(exist_ok=True)
    desk.objects.write_text("no folder")
    with pytest.raises(
        CompilerError, match=r"^expected SYMGEN_OBJECTS to be a folder, got the fil"
    ):
        desk.build("arm")
    monkeypatch.delenv("SYMGEN_OBJECTS")
    monkeypatch.setenv("SYMGEN_CACHE", str(desk.objects.parent))
    desk.build("arm")
    assert desk.objects.read_text() == "no folder"


def test_a_folder_that_disappears_during_a_build(desk: Desk) -> None:
    """Property: what others delete while a build runs does not end it."""
    desk.build("arm")
    objects = Objects("arm", find_compiler())
    shutil.rmtree(desk.objects)
    desk.objects.write_text("no folder")
    objects.prune()


def test_a_full_disk_leaves_no_draft(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: the build goes on without the cache; drafts of killed builds go after an hour."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        objects = Objects("arm", find_compiler())
        unit = desk.objects.parent / "unit.o"
        unit.write_bytes(b"object")
        source = desk.objects.parent / "unit.c"
        source.write_text("int x;")
        objects.keep(source, (), unit)
    assert not list(desk.objects.iterdir())
    draft = desk.objects / ".killed.new"
    draft.write_bytes(b"half")
    objects.prune()
    assert draft.exists()
    past = time.time() - DRAFT_S - 60
    os.utime(draft, (past, past))
    objects.prune()
    assert not draft.exists()
