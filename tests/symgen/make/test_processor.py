"""Levels of an own robot: this processor's and the portable one; the cost that is printed."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

import symgen.make.compiler as room
from runtime.library import load
from symgen.catalogue import make_catalogue
from symgen.chain import read_chain
from symgen.cli import app
from symgen.make import pipeline
from symgen.make.compiler import PROCESSOR_FLAGS, level_names, levels_of_processor
from symgen.make.pipeline import expected_cost, expected_memory
from symgen.make.request import BuildRequest
from tests.conftest import TINY_URDF


def test_the_level_is_that_of_the_library(tiny_built: Path) -> None:
    """Oracle: the check by cpuid in the compiled library."""
    levels = levels_of_processor()
    assert levels[-1] == "portable"
    assert levels[0] == load(tiny_built).level


@pytest.mark.parametrize("level", ["v4", "v3", "v2", None])
def test_the_level_of_other_processors(
    level: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: all flags of a level are needed; without a list of flags all levels are built."""
    monkeypatch.setattr(room, "machine", lambda: "x86_64")
    monkeypatch.setattr(room, "find_compiler", lambda: ("cc",))
    monkeypatch.setattr(room, "accepts_level", lambda *_: True)
    monkeypatch.setattr(room, "CPUINFO", tmp_path / "cpuinfo")
    assert levels_of_processor() == ()
    flags = sorted(PROCESSOR_FLAGS[level]) if level else ["fpu"]
    text = f"processor : 0\nflags\t\t: fpu {' '.join(flags)}\n"
    (tmp_path / "cpuinfo").write_text(text, encoding="utf-8")
    assert levels_of_processor() == ((level, "portable") if level else ("portable",))
    if level:
        (tmp_path / "cpuinfo").write_text(text.replace(flags[0], "other"), encoding="utf-8")
        assert level not in levels_of_processor()


def test_a_compiler_without_the_set_takes_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: an older compiler gets the best level that it knows."""
    monkeypatch.setattr(room, "machine", lambda: "x86_64")
    monkeypatch.setattr(room, "_flags", lambda: set(PROCESSOR_FLAGS["v4"]))
    monkeypatch.setattr(room, "accepts_level", lambda _, level: level != "v4")
    assert levels_of_processor() == ("v3", "portable")


def test_what_the_command_compiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: own robots two levels, bundled ones all, options as they say, never both."""
    seen = []

    def build(request: BuildRequest, root: Path, *words: object) -> pipeline.BuildResult:
        seen.append(words[1])
        return pipeline.BuildResult(root / request.name, False, ())

    monkeypatch.setattr("symgen.cli.make.build", build)
    (tmp_path / "own.urdf").write_text(TINY_URDF, encoding="utf-8")
    own = ["build", "--urdf", str(tmp_path / "own.urdf"), "--name", "own", "--out", str(tmp_path)]
    for words in (
        own,
        [*own, "--settings", "all_levels=true"],
        [*own, "--settings", "level=casadi"],
        ["build"],
    ):
        assert CliRunner().invoke(app, words).exception is None
    assert seen == [levels_of_processor(), (), ("casadi",), ()]
    error = (
        CliRunner()
        .invoke(app, [*own, "--settings", "all_levels=true", "--settings", "level=v2"])
        .exception
    )
    assert (
        str(error)
        == "the setting level and --settings all_levels=true both name levels; give one of them"
    )


def test_the_cost_is_printed_before_the_compilation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Property: operations, CPU time and memory are known when the compiler fails at once."""
    (tmp_path / "own.urdf").write_text(TINY_URDF, encoding="utf-8")
    monkeypatch.setenv("CC", "false")
    own = ["build", "--urdf", str(tmp_path / "own.urdf"), "--name", "own", "--out", str(tmp_path)]
    ran = CliRunner().invoke(
        app, [*own, "--settings", "level=portable", "--settings", "watch_size=true"]
    )
    assert "'false -std=c99" in str(ran.exception)
    kernels = make_catalogue(read_chain(TINY_URDF)).kernels
    cost = expected_cost(kernels, ["portable"])
    assert cost.operations == sum(len(kernel.instructions) for kernel in kernels)
    assert f"own: {cost}" in " ".join(ran.output.split())
    every = expected_cost(kernels, [])
    assert every.levels == level_names()
    # Measured with GCC 12 on one core: 3.0 s of the portable level with what has no level, 9.2 s
    # in all; one compiler takes 67 MB.
    assert cost.cpu_s == pytest.approx(3.0, rel=0.15)
    assert every.cpu_s == pytest.approx(9.2, rel=0.15)
    one, two = (expected_cost(kernels, [], cores).memory_mb for cores in (1, 2))
    assert two - one == pytest.approx(67, rel=0.15)
    # Measured peaks of generator and two compilers: two-link arm, FR3, Talos; 1.3 as it states.
    for count, measured in ((8309, 153), (55821, 340), (189288, 507)):
        assert 1 / 1.3 < expected_memory(count, 2) / measured < 1.3
