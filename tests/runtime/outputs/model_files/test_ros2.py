"""The ROS 2 package: its sources compile, and its plugin computes the torques of the library."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from defusedxml.ElementTree import fromstring

from runtime.errors import ExportError
from runtime.library import Library
from runtime.outputs.model_files.export import export_model
from runtime.outputs.model_files.formats.ros2 import ROS2
from runtime.outputs.model_files.model import make_model
from runtime.recording import Friction
from tests.oracle import random_states
from tests.runtime.exporting import perturbed

STUBS = Path(__file__).parents[3] / "stubs" / "ros2"
TERMS = Friction(("viscous", "coulomb", "offset"), coulomb_speed=0.05)


@pytest.fixture(scope="module")
def tree(robot: Callable[[str], Library]) -> Library:
    return robot("tree")


@pytest.fixture(scope="module")
def package(tree: Library, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package of the tree, as `export` writes it."""
    folder = tmp_path_factory.mktemp("ros2")
    phi = np.random.default_rng(0).uniform(0.1, 1, (tree.n_joints, 3))
    (done,) = export_model(tree, perturbed(tree), ["ros2"], folder, terms=TERMS, phi=phi)
    assert done.sentence.startswith("verified:")
    assert done.path == folder / "tree_identified_dynamics"
    return done.path


@pytest.fixture(scope="module")
def plugin(package: Path) -> Path:
    """A program with the plugin, compiled against headers that hold names and signatures alone."""
    compiler = shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        pytest.skip("there is no C++ compiler")
    includes = [f"-I{place}" for place in (package / "include", STUBS)]
    includes.append(f"-I{next((package / 'include').iterdir())}")
    build = package.parent / "build"
    build.mkdir()
    warnings = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")

    def run(*words: object) -> None:
        ran = subprocess.run(
            list(map(str, words)), capture_output=True, text=True, check=False, cwd=build
        )
        assert ran.returncode == 0, ran.stderr

    for name in ("solver", "gravity_compensation"):
        source = package / "src" / f"{name}.cpp"
        run(compiler, "-std=c++17", *warnings, *includes, "-c", source, "-o", build / f"{name}.o")
    run(compiler, "-x", "c", "-std=c99", *includes, "-c", package / "src" / "kernels.c", "-o",
        build / "kernels.o")  # fmt: skip
    objects = [build / f"{name}.o" for name in ("solver", "kernels")]
    run(compiler, "-std=c++17", *includes, STUBS / "driver.cpp", *objects, "-lm", "-o",
        build / "driver")  # fmt: skip
    return build / "driver"


def answers(plugin: Path, states: tuple[np.ndarray, ...], *words: str) -> str:
    rows = np.stack(states, axis=1)
    text = f"{rows.shape[2]} {len(rows)} " + " ".join(repr(float(x)) for x in rows.ravel())
    return subprocess.run([plugin, *words], input=text, capture_output=True, text=True,
                          check=True).stdout  # fmt: skip


def test_the_plugin_computes_the_torques_of_the_library(tree: Library, plugin: Path) -> None:
    """Oracle: τ, C dq, g, friction and M of the library for the same π.

    1e-12 of the largest torque: the same statements, at another optimisation of the compiler.
    """
    n, states = tree.n_joints, random_states(tree.n_joints, 20, 4)
    lines = answers(plugin, states).splitlines()
    read = np.array([[float.fromhex(word) for word in line.split()] for line in lines])
    q, dq, ddq = states
    pi, rest = perturbed(tree), np.zeros_like(q)
    phi = np.random.default_rng(0).uniform(0.1, 1, (n, 3))
    gravity = tree.bias_forces(q, rest, pi)
    expected = [
        tree.inverse_dynamics(q, dq, ddq, pi),
        tree.bias_forces(q, dq, pi) - gravity,
        gravity,
        phi[:, 0] * dq + phi[:, 1] * np.tanh(dq / 0.05) + phi[:, 2],
        tree.mass_matrix(q, pi).reshape(len(q), -1),
    ]
    scale = np.abs(expected[0]).max()
    np.testing.assert_allclose(read, np.hstack(expected), rtol=0, atol=1e-12 * scale)


def test_a_list_of_another_length_is_refused(plugin: Path) -> None:
    """Property: one sentence with the parameter and both lengths."""
    said = answers(plugin, random_states(4, 1, 0), "bad")
    assert said.strip() == "expected 4 numbers in the parameter s.damping, got 1"


def test_files_of_the_package(tree: Library, package: Path) -> None:
    """Property: package.xml, plugins.xml and parameters are well-formed and agree in names."""
    manifest = fromstring((package / "package.xml").read_text())
    assert manifest.findtext("name") == package.name
    plugin = fromstring((package / "plugins.xml").read_text())
    assert plugin.get("path") == package.name
    assert plugin.find("class").get("type") == f"{package.name}::Solver"
    parameters = yaml.safe_load((package / "config" / "parameters.yaml").read_text())
    values = parameters["gravity_compensation"]["ros__parameters"]["solver"]
    assert values["pi"] == perturbed(tree).tolist()
    assert values["friction_speed"] == [0.05]
    assert {len(values[key]) for key in ("damping", "dry_friction", "offset")} == {4}
    cmake = (package / "CMakeLists.txt").read_text()
    assert f"project({package.name} C CXX)" in cmake
    compile((package / "launch" / "gravity_compensation.launch.py").read_text(), "launch", "exec")
    everything = "".join(p.read_text() for p in package.rglob("*") if p.is_file())
    assert "@{" not in everything


def test_kernels_of_another_model_are_refused(tree: Library) -> None:
    """Property: kernels.c carries the hash of its model; a folder without it has no package."""
    model = make_model(tree, perturbed(tree))
    written = dict(ROS2.write(model))  # type: ignore[arg-type]
    written["src/kernels.c"] = "/* others */"
    with pytest.raises(ExportError, match=r"kernels\.c of the model of the library"):
        ROS2.check(model, written)
