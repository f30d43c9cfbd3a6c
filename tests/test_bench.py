"""The benchmarks run and tell something sane; how fast we are is not a test's business."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from runtime.library import load
from tests.conftest import REPOSITORY

KERNELS = {
    "inverse_dynamics",
    "torque",
    "torque_jacobian",
    "regressor",
    "base_regressor",
    "mass_matrix",
    "forward_dynamics",
    "end_effector",
    "loss_gradient",
}


def script(name: str, *arguments: str, home: Path) -> Any:
    """What `scripts/<name> --json` prints, its cache in `home`."""
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY), "XDG_CACHE_HOME": str(home)}
    command = [sys.executable, str(REPOSITORY / "scripts" / name), "--json", *arguments]
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("bench")


@pytest.fixture(scope="module")
def build(home: Path) -> Any:
    return script("bench_build", "--out", str(home / "generated"), home=home)


@pytest.fixture(scope="module")
def kernels(home: Path, build: Any) -> Any:
    robot = str(home / "generated" / build["robot"])
    return script("bench_kernels", "--robot", robot, "--repeat", "2", "--no-cpp", home=home)


def test_build_stages_add_up(build: Any) -> None:
    units = {unit["name"]: unit["seconds"] for unit in build["units"]}
    assert {"kernels", "batch"} <= set(units)
    assert all(seconds > 0 for seconds in units.values())
    stages = [build[key] for key in ("generate", "compile", "link")]
    assert min(stages) > 0
    assert sum(stages) <= build["total"]
    assert max(units.values()) <= build["compile"] + 1e-3  # two clocks
    assert 0 < build["again"] < build["total"]


def test_a_build_from_nothing_needs_an_empty_folder(home: Path, build: Any) -> None:
    command = [sys.executable, str(REPOSITORY / "scripts" / "bench_build"), "--out", str(home)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "is not empty" in run.stderr


def test_every_kernel_at_every_level(kernels: Any, home: Path) -> None:
    lib = load(home / "generated" / "fr3")
    expected = lib.levels[: lib.levels.index(lib.level) + 1]
    assert set(kernels["limits"]) == set(expected)
    assert {(r["kernel"], r["level"]) for r in kernels["rows"]} == {
        (kernel, level) for kernel in KERNELS for level in expected
    }


def test_kernel_numbers_are_sane(kernels: Any) -> None:
    for row in kernels["rows"]:
        assert 0 < row["ns"] < 1e6
        assert row["operations"] > 0
        assert row["share"] == pytest.approx(row["gflops"] / kernels["limits"][row["level"]])
        for other in row["peers"].values():
            assert other["ns"] > 0
            assert other["ratio"] == pytest.approx(other["ns"] / row["ns"])
    assert "Pinocchio C++" not in kernels["peers"] | kernels["missing"]
    assert {"CasADi VM", "NumPy"} <= set(kernels["peers"])


def test_an_unknown_robot_is_one_sentence(tmp_path: Path) -> None:
    command = [sys.executable, str(REPOSITORY / "scripts" / "bench_kernels"), "--robot", "nobody"]
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    run = subprocess.run(
        command, capture_output=True, text=True, check=False, env=environment, cwd=tmp_path
    )
    assert run.returncode == 2
    assert "no generated robot is called 'nobody'" in run.stderr
    assert len(run.stderr.splitlines()) == 1
