"""What users install: both packages hold what they should, and the wheel works on its own."""

import json
import os
import re
import shutil
import subprocess
import sys
import venv
import zipfile
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from packaging.requirements import Requirement

from runtime.library import Library
from scripts.packages import faults_of
from tests.conftest import REPOSITORY


def run(*words: object, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*map(str, words)], capture_output=True, text=True, check=False, **options
    )


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sdist, and the wheel that is made from it."""
    pytest.importorskip("hatchling", reason="pip install 'symgen[test]'")
    out = tmp_path_factory.mktemp("dist")
    done = run(sys.executable, "-m", "build", "--no-isolation", "--outdir", out, REPOSITORY)
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def closure(names: list[str]) -> set[str]:
    """Distributions that these need, themselves included, extras left out."""
    distributions: set[str] = set()
    while names:
        name = re.sub(r"[-_.]+", "-", names.pop()).lower()
        if name not in distributions:
            distributions.add(name)
            needs = [Requirement(text) for text in distribution(name).requires or ()]
            names += [r.name for r in needs if not r.marker or r.marker.evaluate({"extra": ""})]
    return distributions


@pytest.fixture(scope="module")
def installed(packages: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Python of an environment with the wheel and its base dependencies, and nothing else.

    The dependencies are links into this environment, which saves a minute and the network.
    """
    home = tmp_path_factory.mktemp("empty") / "venv"
    venv.create(home, symlinks=True)
    (site,) = home.glob("lib/python*/site-packages")
    (wheel,) = packages.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    needs = [
        Requirement(text)
        for text in re.findall(
            r"^Requires-Dist: ([^;\n]+)$", next(site.glob("*.dist-info/METADATA")).read_text(), re.M
        )
    ]
    for name in closure([requirement.name for requirement in needs]):
        for file in distribution(name).files or ():
            top = Path(file).parts[0]
            if top != ".." and not (site / top).exists():
                (site / top).symlink_to(Path(str(distribution(name).locate_file(top))))
    return home / "bin" / "python"


def test_packages_hold_what_they_should(packages: Path) -> None:
    """Oracle: git's list of files, and the specification of the metadata."""
    assert faults_of(packages) == []


def test_faults_are_found(packages: Path, tmp_path: Path) -> None:
    """Property: a library too many and a template too few are both named."""
    for path in packages.glob("symgen*"):
        shutil.copy(path, tmp_path)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as old:
        files = {name: old.read(name) for name in old.namelist()}
    del files["symgen/templates/tiles.c.jinja2"]
    files["runtime/generated/fr3/libfr3.so"] = b"\x7fELF"
    with zipfile.ZipFile(wheel, "w") as new:
        for name, data in files.items():
            new.writestr(name, data)
    assert faults_of(tmp_path) == [
        "the wheel lacks symgen/templates/tiles.c.jinja2",
        "the wheel has runtime/generated/fr3/libfr3.so, which is not ours",
    ]


USE = """
import importlib.util, sys
import runtime
for name in ("casadi", "pinocchio", "mujoco", "tests", "generated"):
    assert importlib.util.find_spec(name) is None, name
assert runtime.load("ur5e").n_joints == 6
lib = runtime.load("fr3")
assert lib.folder.parts[-3:] == ("runtime", "generated", "fr3"), lib.folder
M = lib.mass_matrix(lib.home, lib.pi0)
print(lib.levels, float(M[0, 0]), runtime.__file__)
"""

CONSOLE = """
from importlib.metadata import entry_points
(command,) = entry_points(group="console_scripts", name="symgen")
command.load()()
"""


def test_the_wheel_alone(installed: Path, fr3: Library, tmp_path: Path) -> None:
    """Oracle: pinocchio's mass matrix; property: from wheel to report, the package not written."""
    cache = tmp_path / "home" / ".cache" / "symgen"
    place = {"HOME": str(tmp_path / "home"), "PATH": os.environ["PATH"], "SYMGEN_LEVELS": fr3.level}
    # A compiler cache knows what has been compiled for this level, by messages in this language.
    kept = ("CCACHE_", "LANG", "LC_")
    place |= {name: value for name, value in os.environ.items() if name.startswith(kept)}
    package = next(installed.parents[1].glob("lib/python*/site-packages/runtime"))
    before = {path: path.stat().st_mtime_ns for path in package.rglob("*.[ch]")}
    done = run(installed, "-c", USE, cwd=tmp_path, env=place)
    assert done.returncode == 0, done.stderr
    levels, m11, where = done.stdout.rsplit(maxsplit=2)
    assert Path(where).is_relative_to(package)
    assert levels == f"('{fr3.level}',)"
    model = pinocchio.buildModelFromUrdf(str(package / "generated/fr3/fr3.urdf"))
    home = json.loads((package / "generated/fr3/manifest.json").read_text())["home"]
    M = pinocchio.crba(model, model.createData(), np.array(home))
    assert float(m11) == pytest.approx(M[0, 0], rel=1e-12)  # rounding of some hundred products
    assert "compiling the C code of 'fr3' once" in done.stderr
    assert len(list(cache.rglob("libfr3.so"))) == 1
    assert {path: path.stat().st_mtime_ns for path in package.rglob("*.[ch]")} == before
    assert not list(package.rglob("*.so"))

    again = run(installed, "-m", "runtime", "locate", "nothing", cwd=tmp_path, env=place)
    assert (again.returncode, again.stdout) == (2, "")
    assert again.stderr.startswith("runtime: there is no data set or robot 'nothing'")
    words = ("identify", "fr3_simulated", "--robot", "fr3", "--out", tmp_path / "found")
    identified = run(installed, "-m", "runtime", *words, cwd=tmp_path, env=place)
    assert identified.returncode == 0, identified.stderr
    assert "compiling" not in identified.stderr
    assert (tmp_path / "found" / "report.html").exists()

    build = run(installed, "-m", "symgen", "build", cwd=tmp_path, env=place)
    assert build.returncode == 2
    assert build.stderr.count("\n") == 1
    assert "pip install 'symgen[build]'" in build.stderr

    script = tmp_path / "symgen"
    script.write_text(CONSOLE)
    overview = run(installed, script, cwd=tmp_path, env=place)
    assert (overview.returncode, overview.stderr) == (0, "")
    assert "identify" in overview.stdout
    looked = run(installed, script, "inspect", "fr3_simulated", "--json", cwd=tmp_path, env=place)
    assert looked.returncode in {0, 1}, looked.stderr
    model = run(installed, script, "inspect", package / "generated/fr3/fr3.urdf", env=place)
    assert (model.returncode, model.stderr.count("\n")) == (2, 1)
    assert "inspecting a robot model needs the package" in model.stderr
