"""The benchmarks run and print plausible values; speed itself is not tested."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from runtime.library import Library, load
from tests.conftest import REPOSITORY

ON_TILES = {
    "base_inverse_dynamics",
    "inverse_dynamics",
    "torque",
    "base_regressor",
    "regressor",
    "torque_jacobian",
    "mass_matrix",
    "forward_dynamics",
    "end_effector",
}
AT_EVERY_LEVEL = {"base_inverse_dynamics", "base_regressor"}
KNOWN = "base_inverse_dynamics"


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
def kernels(home: Path, fr3: Library) -> Any:
    robot = str(fr3.folder)
    return script("bench_kernels", "--robot", robot, "--rounds", "1", "--no-cpp", home=home)


def test_start_is_timed(home: Path) -> None:
    """Property: every row of the table has its time and its bar."""
    rows = script("bench_start", "--rounds", "1", "--imports", home=home)
    assert [row["work"] for row in rows] == ["symgen --help", "import runtime"]
    assert [row["goal"] for row in rows] == [0.5, 0.3]
    assert all(0 < row["seconds"] < 60 for row in rows)


def test_every_kernel_on_every_layout(kernels: Any, fr3: Library) -> None:
    """Oracle: the list above; the best level has all kernels, the others two."""
    lib = fr3
    levels = set(kernels["limits"])
    assert {lib.level, "portable"} <= levels <= set(lib.levels)
    best = {(name, lib.level, layout) for name in ON_TILES for layout in ("tiles", "batch")}
    best |= {("loss_gradient", lib.level, "batch")}
    vectors = levels - {"casadi"}
    every = {
        (k, v, layout) for k in AT_EVERY_LEVEL for v in vectors for layout in ("tiles", "batch")
    }
    stored = {("base_inverse_dynamics", level, "stored") for level in vectors}
    rows = [(r["kernel"], r["level"], r["layout"]) for r in kernels["rows"]]
    assert len(rows) == len(set(rows))
    assert {row for row in rows if row[1] != "casadi"} == best | every | stored


def test_kernel_numbers_are_sane(kernels: Any) -> None:
    """Property: what follows from the times follows from the times."""
    for row in kernels["rows"]:
        assert 0 < row["ns"] < 1e6
        assert row["operations"] > 0
        assert row["samples"] % 8 == 0
        # one round, so the medians are the numbers themselves
        assert row["gflops"] == pytest.approx(row["operations"] / row["ns"])
        assert row["share"] == pytest.approx(row["gflops"] / kernels["limits"][row["level"]])
        for other in row["peers"].values():
            assert other["ns"] > 0
            assert other["ratio"] == pytest.approx(other["ns"] / row["ns"])
    assert "Pinocchio C++" not in kernels["peers"] | kernels["missing"]
    assert "CasADi VM" in kernels["peers"]


def test_stored_sines_leave_out_their_operations(kernels: Any) -> None:
    """Property: of seven joints the first one turns about gravity, so twelve sines are left."""
    count = {r["layout"]: r["operations"] for r in kernels["rows"] if r["kernel"] == KNOWN}
    assert count["tiles"] - count["stored"] == 12


def test_every_kernel_agrees_with_pinocchio(kernels: Any) -> None:
    """Oracle: Pinocchio's Python interface, sample by sample; rounding of a few hundred terms."""
    pytest.importorskip("pinocchio")
    assert all(row["deviation"] <= 1e-12 for row in kernels["rows"])
    assert kernels["deviation"] == max(row["deviation"] for row in kernels["rows"])


def test_identification_is_timed_or_skipped(home: Path, fr3: Library) -> None:
    """Property: every entry of the registry either has a row or a reason."""
    robot = str(fr3.folder)
    report = script("bench_identify", "--robot", robot, "--rounds", "1", "--no-trials", home=home)
    labels = [row["label"] for row in report["rows"]] + list(report["skipped"])
    assert len(labels) == len(set(labels)) == 12
    for row in report["rows"]:
        assert 0 < row["seconds"] < 1
        if row["numpy"] is not None:
            assert row["numpy_ratio"] == pytest.approx(row["numpy"] / row["seconds"])
        if row["document"] is not None:
            assert row["document_ratio"] == pytest.approx(row["document"] / row["seconds"])
    for why in report["skipped"].values():
        assert "has no function" in why or "--no-trials" in why


def test_optimisers_of_excitation_solve_the_same_problem(home: Path, fr3: Library) -> None:
    """Oracle: SLSQP on our cost and on Pinocchio's, from one start, end in the same motion."""
    pytest.importorskip("pinocchio")
    robot = str(fr3.folder)
    arguments = ("--robot", robot, "--starts", "1", "--harmonics", "2")
    report = script("bench_excitation", *arguments, home=home)
    starts_of = {row["name"]: row["starts"] for row in report["rows"]}
    assert report["skipped"] == {}
    assert all(len(starts) == 1 and starts[0]["cpu"] > 0 for starts in starts_of.values())
    conditions = [starts_of[name][0]["condition"] for name in starts_of]
    ours, staged, exact, differences = conditions
    # Forward differences leave the last 1e-3 of the descent; another cost would be off by more.
    assert differences == pytest.approx(exact, rel=5e-3)
    assert ours <= exact
    # Ends on the same objective, from a point that the smooth stages chose.
    assert staged <= exact


def test_an_unknown_robot_is_one_sentence(tmp_path: Path) -> None:
    command = [sys.executable, str(REPOSITORY / "scripts" / "bench_kernels"), "--robot", "nobody"]
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    run = subprocess.run(
        command, capture_output=True, text=True, check=False, env=environment, cwd=tmp_path
    )
    assert run.returncode == 2
    assert "no generated robot is called 'nobody'" in run.stderr
    assert len(run.stderr.splitlines()) == 1


def test_samples_fill_tiles(home: Path, fr3: Library) -> None:
    """Property: a number of samples that tiles cannot hold is refused in one sentence."""
    robot = str(fr3.folder)
    script_path = str(REPOSITORY / "scripts" / "bench_kernels")
    command = [sys.executable, script_path, "--robot", robot, "--samples", "12", "--no-cpp"]
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY), "XDG_CACHE_HOME": str(home)}
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert run.returncode == 2
    assert "expected a multiple of it, got 12" in run.stderr


def test_numpy_computes_the_same(fr3: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the functions of runtime; a reference that did less would flatter us."""
    monkeypatch.syspath_prepend(str(REPOSITORY / "scripts"))
    from bench import doors, numpy_identify

    from runtime.estimators.regression.factor import compress
    from runtime.excitation import ConditionCost

    setting = doors.setting(fr3)
    lib, t = setting.lib, setting.trajectory
    shape = (lib, t.home, t.coefficients.shape[1], t.duration)
    value, gradient = numpy_identify.log_condition(*shape)
    expected = ConditionCost(*shape).value_gradient(t.coefficients)
    assert value(t.coefficients) == pytest.approx(expected[0], rel=1e-10)
    slope = gradient(t.coefficients)  # error: curvature 1.5e4 times half a step of 1e-7
    assert slope == pytest.approx(expected[1], abs=1e-3 * abs(expected[1]).max())
    problem = setting.problem()
    statistics, none = compress(lib, setting.train, setting.weights), problem.train.columns[0]
    before = statistics.value(lib.pi_from_lam(problem.start), none)
    data = (lib, problem.start, setting.train, setting.weights)
    descents = (
        (numpy_identify.adam_full(*data), 300, 0.9),
        (numpy_identify.adam_batch(*data, doors.BATCH), 300, 0.9),
        (numpy_identify.levenberg(*data), 30, 1e-3),
    )
    for run, count, share in descents:
        after = statistics.value(lib.pi_from_lam(run(count)), none)
        assert after < share * before


def test_coverage_of_intervals() -> None:
    """Property: intervals hold with white noise; wrong gains are named by `identify`.

    Of 4 trials of 43 parameters, 10 of a payload and 7 gains: shares to 3 and 8 % for the latter.
    """
    from scripts.bench.coverage import coverage
    from scripts.bench.trials import trajectories

    lib = load("fr3")
    designs = trajectories(REPOSITORY / "scripts" / "bench" / "fr3_trials.json", lib)
    right, wrong = (coverage(lib, designs, case, 4) for case in ("white", "gains"))
    assert right.base.mean() > 0.88
    assert min(right.band, right.payload, right.gains) > 0.75
    assert right.named == 0
    assert wrong.named == 1


def test_faults_are_named(fr3: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: a trial of every case; a short log states the limit for the gain of joint 7."""
    monkeypatch.syspath_prepend(str(REPOSITORY / "scripts"))
    from bench.coverage import FAULTS, alarms
    from bench.trials import trajectories

    places = (
        REPOSITORY / "scripts" / "bench" / f"fr3_{name}.json" for name in ("trials", "motion")
    )
    designs, (long,) = (trajectories(place, fr3) for place in places)
    rows = {label: tuple(counts) for label, *counts in alarms(fr3, designs, long, 1)}
    assert len(rows) == len(FAULTS)
    clean = [label for label in rows if label.startswith("none")]
    assert [rows.pop(label) for label in clean] == 3 * [(0, 0, 0)]
    assert rows.pop("torque gain of joint 7 10 % off") == (0, 1, 0)
    # The result follows the data where the URDF is off: that is named, and no doubt of the result.
    off = [label for label in rows if "payload" in label or "bodies" in label]
    assert [rows.pop(label) for label in off] == 4 * [(1, 0, 0)]
    assert {(named, doubted) for named, _, doubted in rows.values()} == {(1, 1)}


def test_rows_of_a_table_are_replaced_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: rows with the same first cells in their places, new ones last, the others kept."""
    monkeypatch.syspath_prepend(str(REPOSITORY / "scripts"))
    from bench.front import markdown, merged

    head = ("problem", "starts", "cond")
    before = markdown(head, [("a", "8", "4.1"), ("a", "24", "3.9"), ("b", "8", "5.0")])
    after = markdown(head, [("c", "8", "2.0"), ("a", "24", "3.8")])
    rows = [("a", "8", "4.1"), ("a", "24", "3.8"), ("b", "8", "5.0"), ("c", "8", "2.0")]
    assert merged(before, after, 2) == markdown(head, rows)
