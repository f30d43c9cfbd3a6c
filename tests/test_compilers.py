"""The C compiler of both packages: which is found, how it is called, and what it compiles."""

import importlib.util
import itertools
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from runtime.common import compiler
from runtime.errors import CompilerError
from runtime.library import load

ON_PATH = ("cc", "gcc", "clang")
PATHS = [names for count in range(4) for names in itertools.combinations(ON_PATH, count)]
ASKED = ("", "gcc", "clang -m64", "no-such-cc")
V2 = {"pni", "ssse3", "cx16", "sse4_1", "sse4_2", "popcnt", "lahf_lm"}
V3 = V2 | {"fma", "movbe", "avx", "f16c", "bmi1", "avx2", "bmi2", "abm"}
V4 = V3 | {"avx512f", "avx512dq", "avx512cd", "avx512bw", "avx512vl"}
LEVEL_FLAGS = (("v4", V4), ("v3", V3), ("v2", V2))
"""Level → flags of /proc/cpuinfo that the x86-64 ABI requires for it."""
MARCHES = ("x86-64-v4", "x86-64-v2", "no-such-set")


def answer() -> tuple[str, ...] | None:
    """The words that call it; None where there is none."""
    try:
        return compiler.find_compiler()
    except CompilerError:
        return None


@pytest.mark.parametrize("wheel", [True, False])
def test_the_compiler_that_is_found(
    wheel: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Property: known words, or none, whatever $CC asks for and the PATH and wheels offer."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: wheel and name == "ziglang")
    found = set()
    for names, asked in itertools.product(PATHS, ASKED):
        folder = tmp_path / "-".join(("path", *names))
        folder.mkdir(exist_ok=True)
        for name in names:
            (folder / name).write_text("#!/bin/sh\n")
            (folder / name).chmod(0o755)
        monkeypatch.setenv("PATH", str(folder))
        monkeypatch.setenv("CC", asked)
        found.add(answer())
    zig = (sys.executable, "-P", "-m", "ziglang", "cc", "-fno-sanitize=undefined")
    last = zig if wheel else None
    assert found == {("cc",), ("gcc",), ("clang",), ("clang", "-m64"), None, last}


def test_flags_are_spelled_and_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: instruction sets in the words of gcc and zig, and which of them there are."""
    zig = (sys.executable, "-P", "-m", "ziglang", "cc")
    for march in MARCHES:
        assert compiler.spelled(f"-march={march}", ("cc",)) == f"-march={march}"
        assert compiler.spelled(f"-march={march}", zig) == f"-march={march.replace('-', '_')}"
    # A compiler that refuses one set, so that the test asks none of this machine.
    monkeypatch.setattr(
        subprocess,
        "run",
        lambda command, **_: subprocess.CompletedProcess(
            command, f"-march={MARCHES[2]}" in command
        ),
    )
    for flags in ([f"-march={MARCHES[1]}"], [f"-march={MARCHES[2]}"], ["-O2"]):
        assert compiler.accepts(("cc",), flags) == (flags != [f"-march={MARCHES[2]}"])


def test_names_of_machines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: the names that the recipe's groups and build records are held against."""
    names = {"AMD64": "x86_64", "arm64": "aarch64"}
    for name in ("x86_64", "AMD64", "arm64", "aarch64", "riscv64"):
        monkeypatch.setattr("platform.machine", lambda name=name: name)
        assert compiler.machine() == names.get(name, name)


def test_every_compiler_chooses_the_same_level(tiny: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the level of the processor is that of /proc/cpuinfo, whoever compiled the library.

    `kernels.c` chooses the level and `tiles.c` gives each level its name; other sources are left
    out of the recipe, which saves two thirds of the time.
    """
    programs = [name for name in ("gcc", "clang", "cc") if shutil.which(name)]
    # By its other name gcc, or clang, may be what has built the pendulum: its objects are known.
    compilers = list(
        {compiler.compiler_version((x,)).split(" ", 1)[-1]: x for x in programs}.values()
    )
    if importlib.util.find_spec("ziglang"):
        compilers.append(f"{sys.executable} -P -m ziglang cc -fno-sanitize=undefined")
    if len(compilers) < 2:
        pytest.skip("one compiler only; the others are gcc, clang and: pip install 'symgen[zig]'")
    (tiny / "libtiny.so").unlink()
    recipe = json.loads((tiny / "compile.json").read_text(encoding="utf-8"))
    for group in recipe["groups"]:
        group["sources"] = [name for name in group["sources"] if name in {"kernels.c", "tiles.c"}]
    (tiny / "compile.json").write_text(json.dumps(recipe), encoding="utf-8")
    levels = {}
    for number, words in enumerate(compilers):
        monkeypatch.setenv("CC", words)
        if "ziglang" in words:
            # As in `test_zig_fallback`: zig compiles its run-time library per C library, 18 s, and
            # looks for that of the machine on the PATH.
            monkeypatch.setenv("PATH", str(tiny))
        monkeypatch.setenv("SYMGEN_CACHE", str(tiny.parent / f"cache{number}"))
        levels[words] = load(tiny).level
    assert set(levels.values()) == {levels[compilers[0]]}, levels
    facts = Path("/proc/cpuinfo")
    if compiler.machine() == "x86_64" and facts.exists():
        (line,) = {x for x in facts.read_text().splitlines() if x.startswith("flags")}
        flags = set(line.partition(":")[2].split())
        expected = next((level for level, needs in LEVEL_FLAGS if needs <= flags), "portable")
        assert levels[compilers[0]] == expected
