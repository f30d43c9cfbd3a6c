"""Commands on a machine without the extra `build`, whose libraries cannot be imported."""

import subprocess
import sys
from pathlib import Path

import pytest

from symgen.cli import BUILD_LIBRARIES, installation
from tests.conftest import REPOSITORY, TINY_URDF

BLOCKED = f"""
import sys
sys.path.insert(0, {str(REPOSITORY)!r})

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {set(BUILD_LIBRARIES)!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Missing())
from symgen.cli.console import main
sys.argv = ["symgen", *sys.argv[1:]]
main()
"""
"""The console command after an import hook that hides the libraries of the build."""


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", BLOCKED, *words],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_list_and_describe_need_no_build_library(tmp_path: Path) -> None:
    """Property: commands that only read manifests run, in an empty folder too."""
    listed = run(tmp_path, "list")
    assert listed.returncode == 0, listed.stderr
    assert "fr3" in listed.stdout
    assert "ur5e" in listed.stdout
    described = run(tmp_path, "describe", "fr3", "--json")
    assert described.returncode == 0, described.stderr
    assert "base_parameters" in described.stdout
    assert run(tmp_path, "clean", "nothing").stderr.startswith("symgen: 'generated/nothing'")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "work"),
    [
        (("inspect", "tiny.urdf"), "inspecting a robot model needs the package"),
        (("build",), "writing the C code of a robot needs the package"),
        (("check",), "writing the C code of a robot needs the package"),
        (("proxies", "tiny.urdf", "--out", "p.toml"), "fitting capsules to a robot needs the"),
    ],
)
def test_the_true_reason_is_stated(words: tuple[str, ...], work: str, tmp_path: Path) -> None:
    """Property: one sentence says which package the command needs and how it is installed."""
    (tmp_path / "tiny.urdf").write_text(TINY_URDF)
    refused = run(tmp_path, *words)
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"symgen: {work}")
    assert refused.stderr.count("\n") == 1
    assert f"run: {installation('build')}" in refused.stderr


def test_installation_names_the_clone() -> None:
    """Property: in a clone the clone is installed, whatever an index has under this name."""
    assert installation("build") == f"pip install -e '{REPOSITORY}[build]'"
