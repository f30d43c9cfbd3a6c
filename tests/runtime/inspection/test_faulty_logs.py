"""Faults in the log of a virtual cobot: currents, gears with much friction, a clock of 10/12 ms.

`scripts/fault_table` puts the same faults into a second arm, which stands on a wall.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime import load, read_recording
from runtime.inspection import Inspection, inspect_log, recipe_text
from runtime.inspection.checks.outlying_rows import outlying_rows
from runtime.recording import Recipe, Recording
from runtime.recording.recipes.recipe_file import load_recipe
from tests.runtime.diagnosis import require_no_warning, sentences
from tests.runtime.faults import FAULTS, JOINT, Fault
from tests.runtime.virtual_arms import Arm, Log, cobot


@pytest.fixture(scope="module")
def arm(shared_data: Path) -> Arm:
    return cobot(load("ur5e"), shared_data / "models" / "universal_robots" / "ur10_robot.urdf")


def inspected(arm: Arm, log: Log, folder: Path) -> Inspection:
    np.savez(folder / "log.npz", **log.arrays)
    return inspect_log(folder / "log.npz", arm.lib, log.recipe)


@pytest.fixture(scope="module")
def faulty(
    arm: Arm, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], tuple[Path, Inspection]]:
    """Log with the fault whose name begins with some words, and its inspection, made once."""
    done: dict[str, tuple[Path, Inspection]] = {}

    def get(start: str) -> tuple[Path, Inspection]:
        fault = next(each for each in FAULTS if each.name.startswith(start))
        if fault.name not in done:
            folder = tmp_path_factory.mktemp("faulty")
            done[fault.name] = folder / "log.npz", inspected(arm, fault.put(arm), folder)
        return done[fault.name]

    return get


Faulty = Callable[[str], tuple[Path, Inspection]]


def test_the_clean_log(arm: Arm, tmp_path: Path) -> None:
    """Property: with its recipe no warning; without it the clock and the unknown unit."""
    assert sentences(inspected(arm, arm.log, tmp_path)) == {}
    bare = inspect_log(tmp_path / "log.npz", arm.lib)
    assert set(sentences(bare)) == {"jitter", "current_unit"}


@pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])
def test_a_fault_is_named(arm: Arm, faulty: Faulty, fault: Fault) -> None:
    """Property: the finding names the fault, with its joint, size or place."""
    findings = faulty(fault.name)[1].findings
    right = [f for f in findings if f.kind in fault.kinds and f.level != "info"]
    assert any(fault.states(arm, f) for f in right), [f.sentence for f in findings]


@pytest.mark.parametrize("place", ["forty rows", "shifted rows", "frozen"])
def test_rows_are_left_out_on_request(arm: Arm, faulty: Faulty, tmp_path: Path, place: str) -> None:
    """Property: read with the proposed recipe, the log has no corrupt row and no warning left."""
    names = {"forty rows": "40 rows", "shifted rows": "9 rows", "frozen": "log frozen"}
    file, found = faulty(names[place])
    assert found.plan.leave_out
    recipe = tmp_path / "proposed.toml"
    recipe.write_text(recipe_text(found), encoding="utf-8")
    assert load_recipe(recipe).leave_out == found.plan.leave_out
    log = read_recording(file, recipe)
    assert any(sentence.startswith("Left out") for sentence in log.history)
    true = arm.log.simulated.motion.q[arm.log.rows]
    kept = np.searchsorted(arm.log.arrays["t"], log.t)
    # Encoder noise and resolution are 1e-5 rad; a missed row of the burst would be 0.3 off.
    assert np.abs(log.q - true[kept]).max() < 1e-3
    assert sentences(inspect_log(file, arm.lib, recipe)) == {}


@pytest.mark.parametrize("both_ways", [True, False])
def test_coupled_gears_act_both_ways(arm: Arm, tmp_path: Path, both_ways: bool) -> None:
    """Property: friction of a motor that turns with two joints loads both; a residual that follows
    another joint's speed one way is no gear.
    """
    log, (j, k) = arm.log, (3, 4)
    dq = log.arrays["dq"]
    friction = 2.0 * np.tanh((dq[:, j] + dq[:, k]) / 0.02)
    current = log.arrays["current"].copy()
    current[:, j] += friction / arm.gains[j]
    current[:, k] += both_ways * friction / arm.gains[k]
    # In N·m, so that the gains are not in doubt.
    recipe = log.recipe.replace(torque=replace(log.recipe.torque, unit="N*m"))
    changed = replace(log, arrays=log.arrays | {"current": current}, recipe=recipe)
    assert ("gear_coupling" in sentences(inspected(arm, changed, tmp_path))) == both_ways


def test_no_tool_weighs_less_than_nothing(faulty: Faulty) -> None:
    """Property: a log under reversed gravity has one finding, which is not a tool of −8 kg."""
    assert set(sentences(faulty("gravity reversed")[1])) == {"gravity"}


@pytest.mark.parametrize("name", ["5 % of the rows", "clock in ms", "torques of two joints"])
def test_a_proposed_recipe_passes_its_inspection(
    arm: Arm, faulty: Faulty, tmp_path: Path, name: str
) -> None:
    """Property: what the recipe corrects is no warning any more."""
    file, proposed = faulty(name)
    require_no_warning(proposed, file, arm.lib, tmp_path)


def test_differentiation_does_not_fail_at_the_proposed_cutoff(tmp_path: Path) -> None:
    """Property: noisy velocities, at whose best cut-off by cross-validation 10 % of the power of
    ddq is noise; the proposal avoids it and passes its inspection.
    """
    arm = cobot(load("ur5e"), tmp_path, seed=2)
    arrays = dict(arm.log.arrays)
    noise = np.random.default_rng(0).normal(size=arrays["dq"].shape)
    np.savez(tmp_path / "log.npz", **arrays | {"dq": arrays["dq"] + 0.05 * noise})
    proposed = inspect_log(tmp_path / "log.npz", arm.lib, arm.log.recipe, propose=True)
    assert sentences(proposed) == {}
    require_no_warning(proposed, tmp_path / "log.npz", arm.lib, tmp_path)


def test_many_spikes_are_named_but_not_listed_in_a_recipe(arm: Arm) -> None:
    """Property: 250 lone spikes in 10,000 rows, more places than a recipe takes."""
    t = 0.01 * np.arange(10_000)
    q = np.sin(t[:, None] + np.arange(arm.lib.n_joints))
    q[20::40, JOINT] += 0.5
    plan, findings = outlying_rows(Recording(t, q), Recipe(), arm.lib)
    assert [f.evidence["rows"] for f in findings] == [250]
    assert plan.leave_out == ()
