"""The compiler step: which compiler is taken, and what is said when there is none or it refuses."""

import ctypes
import importlib.util
import shutil
import sys
from pathlib import Path

import pytest

from symgen.errors import CompilerError
from symgen.make import compiler
from symgen.make.compiler import REFERENCE, find_compiler, level_names, machine, sha256_of
from tests.symgen.builds import compile_library

SOURCE = "double twice(double x);\ndouble twice(double x) { return 2.0 * x; }\n"


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "twice.c"
    path.write_text(SOURCE)
    return path


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A PATH that is an empty folder and no $CC; returns the folder."""
    empty = tmp_path / "empty"
    empty.mkdir()
    monkeypatch.setenv("PATH", str(empty))
    monkeypatch.delenv("CC", raising=False)
    return empty


def works(library: Path) -> bool:
    function = ctypes.CDLL(str(library)).twice
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double]
    return function(21.0) == 42.0


def test_compiles_and_records(source: Path) -> None:
    """Oracle: the library runs; the record is the command, a version and the file's hash."""
    target = source.with_name("libtwice.so")
    done = compile_library([source], target)
    assert works(target)
    assert done.sha256 == sha256_of(target)
    assert done.commands[0][: len(find_compiler())] == find_compiler()
    assert "-o" in done.commands[0]
    assert done.version != "unknown"
    assert not any(
        "fast-math" in flag or str(source.parent) in flag
        for command in done.commands
        for flag in command
    )


def test_complaint_is_shown(source: Path) -> None:
    """Property: a refused source shows the command and the compiler's own words."""
    source.write_text("double broken(double x) { return y; }\n")
    with pytest.raises(CompilerError, match=r"(?s)-c twice\.c -o twice\.o' failed:.*\by\b"):
        compile_library([source], source.with_name("libtwice.so"))
    assert not source.with_name("libtwice.so").exists()


def test_no_compiler_at_all(no_compiler: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: the sentence lists what was looked for and how to get one."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(CompilerError, match=r"no C compiler found .* pip install ziglang"):
        find_compiler()


def test_cc_that_is_not_there(monkeypatch: pytest.MonkeyPatch, source: Path) -> None:
    """Property: a wrong $CC is named and never silently replaced."""
    monkeypatch.setenv("CC", "no-such-cc --flag")
    with pytest.raises(CompilerError, match=r"\$CC names the compiler 'no-such-cc'.* unset CC"):
        compile_library([source], source.with_name("libtwice.so"))


def test_cc_that_fails_without_a_word(monkeypatch: pytest.MonkeyPatch, source: Path) -> None:
    """Property: exit status and a missing library are both failures."""
    target = source.with_name("libtwice.so")
    for program, state in (("false", "with exit status 1"), ("true", "without its output")):
        monkeypatch.setenv("CC", program)
        sentence = rf"(?s)'{program} -std=c99 .*' failed:.it ended {state} and no message"
        with pytest.raises(CompilerError, match=sentence):
            compile_library([source], target)


def test_cc_with_arguments(monkeypatch: pytest.MonkeyPatch, source: Path) -> None:
    """Property: $CC may carry flags, as in make."""
    plain = find_compiler()
    monkeypatch.setenv("CC", " ".join([*plain, "-DUNUSED=1"]))
    assert find_compiler() == (*plain, "-DUNUSED=1")
    assert compile_library([source], source.with_name("libtwice.so")).commands[0][1] == "-DUNUSED=1"


def test_order_of_search(no_compiler: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: cc before gcc before clang before the wheel."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name == "ziglang")
    zig = (sys.executable, "-P", "-m", "ziglang", "cc", "-fno-sanitize=undefined")
    assert find_compiler() == zig
    for name in ("clang", "gcc", "cc"):
        program = no_compiler / name
        program.write_text("#!/bin/sh\n")
        program.chmod(0o755)
        assert find_compiler() == (name,)


def test_zig_fallback(no_compiler: Path, source: Path) -> None:
    """Oracle: the ziglang wheel alone builds a library that runs."""
    if importlib.util.find_spec("ziglang") is None:
        pytest.skip("the ziglang wheel is not installed: pip install symgen[zig]")
    target = source.with_name("libtwice.so")
    assert compile_library([source], target).commands[0][1:5] == ("-P", "-m", "ziglang", "cc")
    assert works(target)


def test_flags_are_safe() -> None:
    """Property: nothing that breaks NaN or range reduction; the C standard is stated."""
    assert "-std=c99" in compiler.FLAGS
    assert not {"-ffast-math", "-Ofast", "-ffinite-math-only"} & set(compiler.FLAGS)


def test_unhurried_sources_are_not_optimised(source: Path) -> None:
    """Property: the reference is compiled without optimisation, everything else with it."""
    plain = source.with_name("plain.c")
    plain.write_text(
        "#ifdef __OPTIMIZE__\n#error optimised\n#endif\nint plain(void);\n"
        "int plain(void) { return 1; }\n"
    )
    source.write_text(f"#ifndef __OPTIMIZE__\n#error slow\n#endif\n{SOURCE}")
    target = source.with_name("libtwice.so")
    compile_library([source], target, unhurried=[plain])
    assert works(target)
    assert ctypes.CDLL(str(target)).plain() == 1


def test_levels_that_the_compiler_does_not_know_are_left_out(
    monkeypatch: pytest.MonkeyPatch, source: Path, tmp_path: Path
) -> None:
    """Property: an older compiler gives a library with fewer levels, not an error."""
    if machine() != "x86_64":
        pytest.skip("the levels of this test are those of x86-64")
    old = tmp_path / "old-cc"
    refuse = 'case "$*" in *x86-64-v[34]*) echo "bad value for -march" >&2; exit 1;; esac'
    old.write_text(f'#!/bin/sh\n{refuse}\nexec {shutil.which("cc") or "gcc"} "$@"\n')
    old.chmod(0o755)
    monkeypatch.setenv("CC", str(old))
    level = source.with_name("level.c")
    level.write_text(
        "#define JOIN(x) f_##x\n#define AT(x) JOIN(x)\nint AT(LEVEL)(void) { return W; }\n"
    )
    target = source.with_name("libtwice.so")
    compile_library([source], target, [level])
    library = ctypes.CDLL(str(target))
    assert library.f_v2() == 2
    assert not hasattr(library, "f_v3")
    assert not hasattr(library, "f_v4")


def test_wanted_levels_alone_are_compiled(source: Path) -> None:
    """Property: levels not requested are not in the library; an unknown name is one sentence."""
    plain, level = source.with_name("plain.c"), source.with_name("level.c")
    plain.write_text("int plain(void);\nint plain(void) { return 1; }\n")
    level.write_text(
        "#define JOIN(x) f_##x\n#define AT(x) JOIN(x)\nint AT(LEVEL)(void) { return W; }\n"
    )
    target = source.with_name("libtwice.so")
    compile_library([source], target, [level], [plain], ["portable"])
    library = ctypes.CDLL(str(target))
    assert library.f_portable() == 1
    others = [name for name in level_names() if name not in {"portable", REFERENCE}]
    assert others or machine() not in {"x86_64", "aarch64"}
    assert not any(hasattr(library, name) for name in ["plain", *(f"f_{x}" for x in others)])
    before = target.read_bytes()
    with pytest.raises(
        CompilerError, match=f"no level 'v9' on {machine()}; its levels are .*portab"
    ):
        compile_library([source], target, [level], [plain], ["v9"])
    with pytest.raises(
        CompilerError, match=r"only the reference of the other levels; add one of .*portable"
    ):
        compile_library([source], target, [level], [plain], [REFERENCE])
    assert target.read_bytes() == before


def test_a_wanted_level_that_the_compiler_does_not_support_is_named(
    monkeypatch: pytest.MonkeyPatch, source: Path, tmp_path: Path
) -> None:
    """Property: a level requested by name is never left out silently."""
    best = level_names()[0]
    if best == "portable":
        pytest.skip("this machine has one level alone")
    old = tmp_path / "old-cc"
    old.write_text('#!/bin/sh\ncase "$*" in *-E*) exit 1;; esac\nexec cc "$@"\n')
    old.chmod(0o755)
    monkeypatch.setenv("CC", str(old))
    with pytest.raises(CompilerError, match=f"cannot compile for the level '{best}'"):
        compile_library([source], source.with_name("libtwice.so"), [source], wanted=[best])


def test_the_portable_level_beside_a_better_one_is_not_optimised(source: Path) -> None:
    """Property: -O0 and tiles by sample beside another level; -O1 and vector code where none is."""
    names = [name for name in level_names() if name != REFERENCE]
    if len(names) == 1:
        pytest.skip("this machine has the portable level only")
    source.write_text("typedef double number;\n")  # no name twice in the library

    def last_option(wanted: tuple[str, ...]) -> tuple[str, bool]:
        done = compile_library([], source.with_name("lib.so"), [source], wanted=wanted)
        portable = next(c for c in done.commands if "-DLEVEL=portable" in c)
        level = [flag for flag in portable if flag.startswith("-O")][-1]
        return level, "-DBY_SAMPLE" in portable

    assert last_option((names[-2], "portable")) == ("-O0", True)
    assert last_option(()) == ("-O0", True)
    assert last_option(("portable",)) == ("-O1", False)
