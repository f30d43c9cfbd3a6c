"""Findings that real logs have refuted: each one is true of the log, or is not made."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from runtime import load
from runtime.inspection import INFO, Inspection, inspect_log, recipe_text
from runtime.inspection.checks.drives import delay_of_measured
from runtime.inspection.checks.signals import constant_velocity
from runtime.library import Library
from runtime.recording import Friction, Recipe, Recording
from runtime.recording.friction.model import columns
from runtime.recording.preprocessing.segments import differentiate
from runtime.recording.recipes.recipe import ControlLaw, Signal, Time
from runtime.recording.settings import JointMotion
from tests.runtime.servo_logs import random_servo, servo_arrays

CURRENTS = (
    '[time]\nlayout = "npz"\nkey = "t"\nunit = "s"\n'
    '[position]\nlayout = "npz"\nkey = "q"\nunit = "rad"\n'
    '[velocity]\nlayout = "npz"\nkey = "dq"\nunit = "rad/s"\n'
    '[torque]\nlayout = "npz"\nkey = "tau"\nunit = "A"\n'
)


def warned(inspection: Inspection) -> set[str]:
    """Kinds of the warnings and errors."""
    return {finding.kind for finding in inspection.findings if finding.level != INFO}


def test_encoder_noise_at_rest_is_no_repeated_state(lib: Library, clean: Recording, saved) -> None:
    """Property: positions without velocities that repeat at rest are no states logged twice.

    The noise is 8 counts of the finest step; of two neighbouring rows some are equal by chance.
    """
    rng = np.random.default_rng(0)
    rest = np.arange(400)
    count = 2.0**-18
    steps = rng.choice([0.0, 8.0, 9.0], size=(len(rest), 1), p=[0.5, 0.25, 0.25])
    moving = np.round(clean.q / count) * count
    q = np.vstack([moving, moving[-1] + count * steps * (np.arange(7) == 5)])
    t = np.concatenate([clean.t, clean.t[-1] + (1 + rest) * np.median(np.diff(clean.t))])
    tau = np.vstack([clean.tau, np.repeat(clean.tau[-1:], len(rest), axis=0)])
    tau += 1e-3 * rng.normal(size=tau.shape)
    assert "repeated_rows" not in warned(inspect_log(saved(clean, t=t, q=q, dq=None, tau=tau), lib))


def test_currents_whose_gains_differ_in_sign_are_explained(
    lib: Library, clean: Recording, saved, tmp_path: Path
) -> None:
    """Property: gains that are unknown, of either sign, leave no torque unexplained, also where a
    joint rests under friction of any size; neither tool, gear nor gain of a joint is asserted.
    """
    full = differentiate(clean)
    moves = np.arange(7) != 0
    q = np.where(moves, full.q, full.q[0])
    tau = lib.inverse_dynamics(q, full.dq * moves, full.ddq * moves, lib.pi0)
    tau[:, 0] += 8.0 * np.sign(np.sin(2 * np.pi * full.t / 3.0))
    gains = np.array([0.5, -15.0, 4.0, -9.0, 20.0, -6.0, 12.0])
    rng = np.random.default_rng(1)
    current = tau / gains + 1e-3 * rng.normal(size=tau.shape)
    (tmp_path / "currents.toml").write_text(CURRENTS)
    log = saved(full, q=q, dq=full.dq * moves, tau=current)
    result = inspect_log(log, lib, tmp_path / "currents.toml")
    assert not warned(result) & {"unexplained", "tool", "gear_coupling", "torque_gain"}
    assert "current_gains" in {finding.kind for finding in result.findings}
    assert "little_torque" not in {finding.kind for finding in result.findings}


def test_rotors_of_currents_are_no_delay() -> None:
    """Property: currents of an industrial arm carry rotors and friction with a memory, no delay."""
    lib, rng = load("ur5e"), np.random.default_rng(0)
    t, w = np.arange(0, 20, 0.01), 0.2 * np.pi * np.arange(1, 6)
    a, angle = rng.normal(size=(6, 5)), t[:, None, None] * w + rng.uniform(0, 7, (6, 5))
    dq = (a * np.cos(angle)).sum(axis=2)
    s = 2.0 / np.abs(dq).max(axis=0)
    q, dq, ddq = (
        s * (a / w * np.sin(angle)).sum(axis=2),
        s * dq,
        s * (-a * w * np.sin(angle)).sum(2),
    )
    z = columns(JointMotion(dq, q), Friction(("dahl",), dahl_stroke=4e-3))[..., 0]
    drive = np.array([150.0, 150.0, 150.0, 28.0, 28.0, 28.0])
    dry = 0.04 * (1 + 0.3 * np.exp(-((dq / 0.08) ** 2))) * z
    tau = drive * (0.004 * ddq + 0.03 * dq + dry + 0.003 * rng.normal(size=q.shape))
    tau += lib.inverse_dynamics(q, dq, ddq, lib.pi0)
    found = delay_of_measured(
        Recording(t=t, q=q, dq=dq, tau=tau / 10), lib, Recipe(), Friction(), has_gains=False
    )
    assert [each.kind for each in found] == ["delay"], found[0].sentence
    low, high = found[0].evidence["interval_s"]
    assert low <= 0.0 <= high


def test_joints_at_rest_are_no_exact_model(lib: Library, clean: Recording, saved) -> None:
    """Property: constant torques of joints at rest fit any model; the joint that sweeps one way has
    a ripple of friction that no column explains.
    """
    rng, q, dq = np.random.default_rng(1), np.tile(clean.q[0], (len(clean), 1)), 0.0 * clean.q
    q[:, 0] = 0.3 * (clean.t - clean.t[0]) - 0.9
    dq[:, 0] = 0.3
    tau = lib.inverse_dynamics(q, dq, 0.0 * q, lib.pi0)
    tau[:, 0] += 5.0 + 0.3 * np.sin(40.0 * q[:, 0])
    result = inspect_log(saved(clean, q=q, dq=dq, tau=tau + rng.normal(0, 0.05, q.shape)), lib)
    assert "not_measured" not in warned(result)


def test_placeholders_are_compared_with_no_torque(
    lib: Library, clean: Recording, saved, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: links of 1 kg that stand for missing inertials contradict no torque."""
    placed = dict.fromkeys(lib.link_names, "placeholder")
    monkeypatch.setattr(lib, "manifest", replace(lib.manifest, assumed=placed))
    pi0 = np.tile([1.0, 0, 0, 0, 1e-3, 1e-3, 1e-3, 0, 0, 0], lib.n_joints)
    monkeypatch.setattr(lib, "pi0", pi0)
    result = inspect_log(saved(clean), lib)
    assert not warned(result)
    (finding,) = (f for f in result.findings if f.kind == "placeholders")
    assert len(finding.evidence["links"]) == len(placed)


def test_a_velocity_that_was_not_measured_is_named(lib: Library, clean: Recording) -> None:
    """Property: a column of zeros beside a position that changes; the joint and its travel.

    Without a control law, which needs the logged ones, all velocities are computed from q then.
    """
    assert clean.dq is not None
    plan = Recipe(time=Time(unit="s"), position=Signal("rad"), velocity=Signal("rad/s"))
    assert constant_velocity(clean, plan, lib) == (plan, [])
    dead = clean.replace(dq=clean.dq * (np.arange(7) != 5))
    changed, (finding,) = constant_velocity(dead, plan, lib)
    assert changed.velocity is None
    of_law = SimpleNamespace(law=ControlLaw("pd", 1.0, 1.0, "q_des"))
    assert constant_velocity(dead, of_law, lib)[0] is of_law
    assert finding.evidence["joints"] == [5]
    assert finding.evidence["travel"] == pytest.approx([np.ptp(clean.q[:, 5])])


def test_the_recipe_of_a_servo_log_passes_its_own_inspection(lib: Library, tmp_path: Path) -> None:
    """Property: a cut-off that leaves noise in the accelerations is not proposed."""
    rng = np.random.default_rng(0)
    servo = replace(random_servo(lib, rng), pi=lib.pi0, bias=np.zeros(lib.n_joints))
    arrays = servo_arrays(lib, servo, rng)
    arrays = {key: values for key, values in arrays.items() if key != "tau_true"}
    arrays["dq"] = arrays["dq"] + 0.05 * rng.normal(size=arrays["dq"].shape)
    np.savez(tmp_path / "servo.npz", **arrays)
    first = inspect_log(tmp_path / "servo.npz", lib)
    (tmp_path / "r.toml").write_text(recipe_text(first))
    again = inspect_log(tmp_path / "servo.npz", lib, tmp_path / "r.toml")
    assert "differentiation" not in warned(first) | warned(again)
    assert first.plan.preparation.cutoff_hz < 10.0


def test_noise_of_a_velocity_that_is_fed_back_is_no_delay(lib: Library, clean: Recording) -> None:
    """Property: the law brakes with the noisy speed of the drive, so that the torque contains its
    noise; by logged speeds alone it is 2 to 7 ms early, by positions it is not. A delay
    that is there is found.
    """
    rng, damping = np.random.default_rng(2), 100 * np.diag(lib.mass_matrix(lib.home, lib.pi0))
    assert clean.dq is not None
    assert clean.tau is not None
    noise = 0.02 * rng.normal(size=clean.q.shape)
    plan, terms = Recipe(time=Time(unit="s"), position=Signal("rad")), Friction()
    for late in (0.0, 0.02):
        fed_back = clean.tau - damping * noise
        tau = np.column_stack([np.interp(clean.t - late, clean.t, row) for row in fed_back.T])
        log = clean.replace(dq=clean.dq + noise, tau=tau)
        *_, finding = delay_of_measured(log, lib, plan, terms)
        low, high = finding.evidence["interval_s"]
        assert low <= late <= high
        assert high - low < 0.02
