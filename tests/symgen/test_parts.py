"""Long bodies in several functions: the same numbers from Python, and from compiled C."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from runtime.library import Library, load
from symgen.emit.sample import LONG, parts_of
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.robots import DATA, ONE_LEVEL


def straight_line(count: int, seed: int = 0) -> list[str]:
    """Statements that use random earlier values, and an output of every seventh."""
    rng = np.random.default_rng(seed)
    lines = ["const double t0 = x[0];", "const double t1 = x[1];"]
    for k in range(2, count):
        a, b = rng.integers(max(0, k - 40), k, 2) if rng.random() < 0.9 else rng.integers(0, k, 2)
        lines.append(f"const double t{k} = {rng.choice(['sin', 'cos'])}(t{a}) - 0.5 * t{b};")
        if k % 7 == 0:
            lines.append(f"y[{k // 7 - 1}] = t{k};")
    return lines


def run(lines: list[str], scope: dict, names: dict) -> None:
    """Execute C statements as Python, values in `names`."""
    for line in lines:
        exec(line.removeprefix("const double ").rstrip(";"), scope, names)  # noqa: S102


def test_parts_compute_the_same_numbers() -> None:
    """Oracle: the statements in one piece, executed; every part sees the arguments and w only."""
    lines, x = straight_line(700), [0.3, -0.4]
    scope = {"sin": np.sin, "cos": np.cos}
    whole = np.zeros(100)
    run(lines, scope, {"x": x, "y": whole})
    for size in (10, 64, 10000):
        parts = parts_of(lines, size)
        y, w = np.zeros(100), np.full(parts.stored, np.nan)
        for body in parts.bodies:
            run(body, scope, {"x": x, "y": y, "w": w})
        np.testing.assert_array_equal(y, whole)
    assert parts.stored == 0


def test_places_are_used_again() -> None:
    """Property: a chain, where each value is needed by the next only, stores one number and
    reads another.
    """
    lines = ["const double t0 = x[0];"]
    lines += [f"const double t{k} = sin(t{k - 1});" for k in range(1, 100)]
    parts = parts_of([*lines, "y[0] = t99;"], 10)
    assert parts.stored == 2


def test_arms_of_seven_joints_stay_whole(fr3: Library) -> None:
    """Property: no function of the FR3 is as long as one that is split, and none is split."""
    text = (fr3.folder / "kernels.c").read_text(encoding="utf-8")
    longest = max(body.count("\n    const double t") for body in text.split("\n}\n"))
    assert 1000 < longest < LONG
    assert "_part_" not in text


def test_compiled_parts_agree_with_the_tiles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: torques of kernels in parts of 50 statements equal those of the vector code."""
    monkeypatch.setattr("symgen.emit.sample.LONG", 100)
    monkeypatch.setattr("symgen.emit.sample.parts_of", partial(parts_of, size=50))
    request = BuildRequest("gantry", (DATA / "gantry.urdf").read_text())
    folder = build(request, tmp_path, levels=ONE_LEVEL).folder
    assert "torque_derivatives_part_2(" in (folder / "kernels.c").read_text()
    lib = load(folder)
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, 5, 4))
    tau, by_q, _, mass = lib.torque_derivatives(q, dq, ddq, lib.pi0)
    np.testing.assert_allclose(tau, lib.inverse_dynamics(q, dq, ddq, lib.pi0), atol=1e-12)
    np.testing.assert_allclose(mass, lib.mass_matrix(q, lib.pi0), atol=1e-12)
    h = 1e-6
    for k, e in enumerate(h * np.eye(4)):
        ends = [lib.inverse_dynamics(q + s * e, dq, ddq, lib.pi0) for s in (1, -1)]
        np.testing.assert_allclose(by_q[:, :, k], (ends[0] - ends[1]) / (2 * h), atol=1e-6)
