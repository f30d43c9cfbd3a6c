"""Friction columns of geared joints: what they depend on is recovered, and σ of the arm holds."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime import load
from runtime.campaign.campaign import Plan, _rehearsed
from runtime.campaign.gate import RehearsalVerdict, torque_faults, unnoticed
from runtime.campaign.gear_friction import (
    HIGHEST,
    LOWEST,
    PREPARATION,
    SPACING,
    GearFriction,
    _waves,
    agreement_of,
    arm_model,
    errors_of,
    friction_columns,
    gear_of,
    slope_columns,
    smoothed,
)
from runtime.campaign.shortest_session import base_covariance
from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.library import Library
from runtime.recording import Recording
from runtime.simulation.settings import VirtualFriction
from runtime.simulation.virtual_robot import SimulatedFriction

STROKE, PEAK_SPEED, WAVES, DELAY, NOISE = 1.4e-3, 0.15, 9.0, 8e-4, 0.02
FINE, STEP = 4, 2.5e-4
"""Steps of the friction per row, and their length [s]: the stroke is passed in several of them."""


def moved(
    lib: Library,
    seconds: float,
    seed: int,
    ripple: float = 0.06,
    load: float = 0.0,
    dry: float = 0.5,
) -> Recording:
    """A log of a prescribed motion with the friction of the virtual robot, at 1 kHz."""
    n, rng = lib.n_joints, np.random.default_rng(seed)
    t = STEP * np.arange(round(seconds / STEP))
    f, phase = rng.uniform(0.15, 0.6, size=(2, 3, n)), rng.uniform(0, 6, size=(3, n))
    angle = 2 * np.pi * f[0] * t[:, None, None] + phase
    size = 0.5 * f[1]
    q = (size * np.sin(angle)).sum(axis=1)
    dq = (size * 2 * np.pi * f[0] * np.cos(angle)).sum(axis=1)
    ddq = -(size * (2 * np.pi * f[0]) ** 2 * np.sin(angle)).sum(axis=1)
    one = np.ones(n)
    law = VirtualFriction(
        coulomb=dry * one,
        asymmetry=0.1 * one,
        stribeck=0.3 * one,
        stribeck_speed=PEAK_SPEED * one,
        viscous=0.2 * one,
        load=0.01 * one,
        ripple=ripple * one,
        ripple_waves=WAVES * one,
        ripple_phase=0.3 * one,
        dahl_stroke=STROKE * one,
    )
    joints = SimulatedFriction(law, STEP, np.arange(n))
    tau = lib.inverse_dynamics(q, dq, ddq, (1 + load) * lib.pi0)
    friction = np.zeros_like(tau)
    for k in range(1, len(t)):  # grows with the torque behind the joint, friction included
        friction[k] = joints.advance(q[k], dq[k], tau[k] + friction[k - 1])[0]
    tau = tau + friction
    late = np.stack([np.interp(t - DELAY, t, row) for row in tau.T], axis=1)
    t, q, dq, late = (each[::FINE] for each in (t, q, dq, late))
    q = q + 5e-6 * rng.normal(size=q.shape)
    late = late + NOISE * rng.normal(size=q.shape)
    return Recording(t, q, dq, None, late, name="log", joint_names=lib.joint_names)


@pytest.fixture
def arm(tiny: Path) -> Library:
    return load(tiny)


def test_what_the_columns_depend_on_is_recovered(arm: Library) -> None:
    """Oracle: the friction of the virtual robot, an integrated Dahl state.

    Tolerances are four of the standard deviations of five seeds: 1 % of the stroke, 1 % of the
    speed, 0.16 waves, 0.14 ms.
    """
    log = smoothed(moved(arm, 8.0, 1), arm)
    gear = gear_of([log], arm, PREPARATION, GearFriction.usual(arm.n_joints))
    np.testing.assert_allclose(gear.stroke, STROKE, rtol=0.04)
    np.testing.assert_allclose(gear.peak_speed, PEAK_SPEED, rtol=0.04)
    np.testing.assert_allclose(gear.waves, WAVES, atol=0.64)
    np.testing.assert_allclose(gear.delay, DELAY, atol=5.6e-4)


def test_sigma_holds_and_a_changed_arm_disagrees(arm: Library) -> None:
    """Property: errors of β within four σ; another load is beyond the band.

    A cable of 0.3 % of the 10 N·m of this joint looks like half of the weight of its link.
    """
    logs = [(f"log {k}", smoothed(moved(arm, 6.0, k), arm)) for k in (1, 2)]
    model = arm_model(arm, logs)
    spread = base_covariance(model.result)
    error = model.result.beta - arm.base_matrix @ arm.pi0
    assert np.abs(error / np.sqrt(np.diag(spread))).max() < 4
    new = moved(arm, 4.0, 3)
    assert max(agreement_of(model, smoothed(new, arm), 0.2)) < 3
    heavy = smoothed(moved(arm, 4.0, 3, load=1.0), arm)
    assert max(agreement_of(model, heavy, 0.2)) > 3


def test_a_wrong_sign_and_a_load_are_named(arm: Library) -> None:
    """Property: a sound log has no fault; a sign and six times the weight are named."""
    log = smoothed(moved(arm, 4.0, 5, load=0.1), arm)
    assert torque_faults(arm, log) == ()
    assert "wrong sign" in torque_faults(arm, log.replace(tau=-log.tau))[0]
    (said,) = torque_faults(arm, smoothed(moved(arm, 4.0, 5, load=5.0), arm))
    assert "times that of the URDF: a load" in said


def test_a_gain_is_named_where_friction_hides_half_of_the_links(arm: Library) -> None:
    """Property: links of 0.52 N·m beside friction of 0.3 N·m show a gain of 1.4, because their
    torque does not resemble friction; the sound log has no fault.
    """
    log = smoothed(moved(arm, 8.0, 5, dry=0.3), arm)
    assert torque_faults(arm, log) == ()
    (said,) = torque_faults(arm, log.replace(tau=1.4 * log.tau))
    assert "1.38 times that of the URDF" in said


def test_a_gain_is_named_where_the_links_outweigh_what_is_left(arm: Library) -> None:
    """Property: links of 0.5 N·m show a gain of 1.4 beside friction and a disturbance of 0.1 N·m,
    although the disturbance hides whether their torque resembles friction.
    """
    log = smoothed(moved(arm, 8.0, 5, dry=0.05), arm)
    shaken = 1.4 * log.tau + 0.14 * np.sin(2 * np.pi * 1.7 * log.t)[:, None]
    (said,) = torque_faults(arm, log.replace(tau=shaken))
    assert "times that of the URDF" in said


def test_dry_friction_is_not_taken_for_the_load(arm: Library) -> None:
    """Oracle: a short log of dry friction that outweighs the links, |τ| is its size at all speeds.
    Without the prior of its σ, 0.02, the column of the load took all of it.
    """
    log = smoothed(moved(arm, 1.5, 4, dry=8.0, load=-0.8), arm)
    gear = gear_of([log], arm, PREPARATION, GearFriction.usual(arm.n_joints))
    assert np.abs(gear.phi[:, 3]).max() < 0.06
    np.testing.assert_allclose(gear.phi[:, 0], 8.0, rtol=0.05)


def test_a_planted_fault_that_passes_is_stated(arm: Library) -> None:
    """Property: named or recovered faults are left out."""
    named = RehearsalVerdict("sign", 0, ("the sign is wrong",), 2.0)
    recovered, missed = RehearsalVerdict("delay", 0, (), 0.01), RehearsalVerdict("gain", 0, (), 0.3)
    (said,) = unnoticed((named, recovered, missed), arm)
    assert "'gain'" in said
    assert arm.joint_names[0] in said
    assert "torque error 30 %" in said
    (said,) = unnoticed((RehearsalVerdict("order", 0, (), np.nan),), arm)
    assert "no model was identified" in said
    assert "nan" not in said


@pytest.mark.parametrize(
    ("k", "option"), [(1, "--duration above 2.5"), (2, "the setting later_duration")]
)
def test_a_refused_motion_names_its_option(
    arm: Library, tmp_path: Path, k: int, option: str
) -> None:
    """Property: all faults come before one remedy, with the option of that motion's duration."""
    path = tmp_path / "rehearsal.json"
    path.write_text(json.dumps({"unnoticed": ["a fault of kind 'one'", "a fault of kind 'two'"]}))
    with pytest.raises(IdentificationError) as refused:
        _rehearsed(arm, Plan("v=1Nm"), Trajectory(arm.home, np.zeros((1, 1)), 2.5), path, k)
    said = str(refused.value)
    assert said.startswith(f"motion {k} is refused in rehearsal: a fault of kind 'one'; a fault")
    assert said.count("longer motions") == 1
    assert option in said


def test_a_joint_without_ripple(arm: Library) -> None:
    """Property: no waves where the residual is noise."""
    log = smoothed(moved(arm, 4.0, 4, ripple=0.0), arm)
    assert not gear_of([log], arm, PREPARATION, GearFriction.usual(arm.n_joints)).waves.any()


def test_waves_are_those_that_explain_most_beside_other_columns() -> None:
    """Oracle: least squares with sine and cosine at each wave number, on a way of half a radian.

    There sine and cosine of few waves are nearly one column.
    """
    q, rng = np.linspace(0.0, 0.5, 300)[:, None], np.random.default_rng(2)
    rest = 0.3 * np.sin(17 * q + 0.4) + 0.1 * rng.normal(size=q.shape)
    basis = np.linalg.qr(np.hstack([np.ones_like(q), q]))[0]
    tried, left = np.arange(LOWEST, HIGHEST, SPACING), []
    for each in tried:
        columns = np.hstack([basis, np.sin(each * q), np.cos(each * q)])
        left.append(np.linalg.norm(rest - columns @ np.linalg.lstsq(columns, rest, rcond=None)[0]))
    rest = rest - basis @ (basis.T @ rest)
    assert _waves(q, rest, basis).tolist() == [tried[np.argmin(left)]]


def test_slopes_of_the_columns() -> None:
    """Oracle: difference quotients by waves and by ln v_s, of the columns and of the torque F φ; a
    joint without a ripple has none.
    """
    t, rng = np.arange(200) / 200.0, np.random.default_rng(0)
    q = np.sin(np.outer(t, [3.0, 4.0]))
    motion = Recording(t, q, dq=np.gradient(q, t, axis=0), tau=rng.normal(size=q.shape))
    gear = replace(GearFriction.usual(2), waves=np.array([WAVES, 0.0]))
    columns, step = friction_columns(motion, gear), 1e-6
    slopes = slope_columns(motion, gear, columns)
    faster = replace(gear, peak_speed=gear.peak_speed * np.exp(step))
    finer = replace(gear, waves=gear.waves + np.array([step, 0.0]))
    by_speed, by_waves = (
        (friction_columns(motion, each) - columns) / step for each in (faster, finer)
    )
    # Second derivatives below 100 over a step of 1e-6.
    np.testing.assert_allclose(slopes[..., 4], by_speed[..., 2], atol=1e-4)
    np.testing.assert_allclose(slopes[..., 5:7], by_waves[..., 5:7], atol=1e-4)
    phi = rng.normal(size=(2, columns.shape[2]))
    errors = errors_of(slopes, phi)[..., 2:]
    for k, quotient in enumerate((by_speed, by_waves)):
        torque = np.einsum("tjm,jm->tj", quotient, phi)
        np.testing.assert_allclose(errors[..., k], torque, atol=1e-3)
