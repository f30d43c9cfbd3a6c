"""Torque columns of known makers, and velocities that are a filter of the positions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from runtime import Recording, load
from runtime.inspection import INFO, inspect_log
from runtime.inspection.checks.signals import velocity_filter
from runtime.inspection.checks.vendor_signals import (
    COMPENSATED,
    CURRENT,
    MEASURED,
    MODEL,
    plain_title,
    vendor_torque,
)
from runtime.library import Library
from runtime.recording import Recipe
from runtime.recording.recipes.recipe import Signal, Time
from tests.runtime.diagnosis import require_no_warning, sentences


@pytest.mark.parametrize(
    ("title", "plain"),
    [
        ("actual_current_0", "actual_current"),
        ("robot.tau_J[3] [N*m]", "tau_j"),
        ("tau_J_d_6", "tau_j_d"),
        ("/joint_states/effort", "effort"),
        ("- arm_7_joint_effort", "arm_7_joint_effort"),
        ("target_moment.csv", "target_moment"),
    ],
)
def test_names_without_index_and_unit(title: str, plain: str) -> None:
    """Property: index, unit, prefix and suffix are no part of the name."""
    assert plain_title(title) == plain


def read_from(title: str, robot: str, unit: str = "N*m") -> Recipe:
    """A recipe whose torque is one array."""
    gain = 9.0 if unit == "A" else None
    return Recipe(
        robot=robot,
        time=Time(rate_hz=100.0),
        position=Signal("rad", layout="npz", key="q"),
        torque=Signal(unit, layout="npz", key=title, gain=gain),
    )


@pytest.mark.parametrize(
    ("robot", "title", "vendor", "meaning", "says"),
    [
        ("", "actual_current_0", "UR RTDE", CURRENT, "A"),
        ("", "actual_current_as_torque", "UR RTDE", COMPENSATED, "5.23/10.11"),
        ("", "target_moment", "UR RTDE", MODEL, "actual_current"),
        ("my_ur10e", "effort", "UR ROS driver", CURRENT, "use_currents_as_efforts"),
        ("", "tau_J", "Franka", MEASURED, "with gravity"),
        ("", "tau_J_d", "Franka", MODEL, "tau_J"),
        ("", "tau_ext_hat_filtered", "Franka", COMPENSATED, "external"),
        ("kinova_gen3", "effort", "Kinova", MEASURED, "lite"),
        ("kinova_gen3", "torque", "Kinova", MEASURED, "sensors"),
        ("", "current_motor", "Kinova", CURRENT, "Gen3 lite"),
        ("xarm7", "effort", "xArm", CURRENT, "no torque sensors"),
        ("piper", "effort", "Piper", CURRENT, "factor of 4"),
        ("tiago", "- arm_7_joint_effort", "PAL TIAGo", CURRENT, "raw motor current"),
    ],
)
def test_what_a_maker_publishes(
    lib: Library, robot: str, title: str, vendor: str, meaning: str, says: str
) -> None:
    """Property: the record states what the signal is; currents are read in A where nothing else
    is stated, and a stated unit stays.
    """
    plan = read_from(title, robot)
    drafted, (finding,) = vendor_torque(plan, lib, is_drafted=True)
    assert finding.kind == "vendor_signal"
    assert finding.evidence["vendor"] == vendor
    assert finding.evidence["meaning"] == meaning
    assert says in finding.sentence
    assert (drafted.torque_source == "current") == (meaning == CURRENT)
    stated, _ = vendor_torque(plan, lib, is_drafted=False)
    assert stated == plan
    known, (again,) = vendor_torque(read_from(title, robot, "A"), lib, is_drafted=False)
    assert known.torque == read_from(title, robot, "A").torque
    assert (again.level == INFO) == (meaning in {CURRENT, MEASURED})


def test_other_names_have_no_record(lib: Library) -> None:
    """Property: a name that no maker is known for gives no finding."""
    for title in ("tau", "effort", "torque", "current"):
        assert vendor_torque(read_from(title, ""), lib, is_drafted=True)[1] == []


def test_currents_of_a_ur_are_read_in_ampere(tmp_path: Path) -> None:
    """Property: a bare CSV with the names of RTDE is read in A, joint by joint.

    Currents follow from the model's torque and gains of 9 to 14 N·m/A.
    """
    ur = load("ur5e")
    rng = np.random.default_rng(0)
    t = np.arange(0, 10, 0.008)
    phase = rng.uniform(0, 6, size=6)
    rate = rng.uniform(2, 4, size=6)
    q = 0.5 * np.sin(rate * t[:, None] + phase) + [0, -1.2, 1.0, -1.5, 0.5, 0]
    dq, ddq = np.gradient(q, t, axis=0), np.gradient(np.gradient(q, t, axis=0), t, axis=0)
    gains = np.array([14.0, 13.0, 13.0, 10.0, 9.0, 9.0])
    tau = ur.inverse_dynamics(q, dq, ddq, ur.pi0) + 2 * dq + 3 * np.tanh(dq / 0.05)
    amps = (tau + 0.1 * rng.normal(size=tau.shape)) / gains
    names = ("actual_q", "actual_qd", "actual_current")
    header = ",".join(["timestamp", *(f"{name}_{j}" for name in names for j in range(6))])
    table = np.column_stack([t, q, dq, amps])
    np.savetxt(tmp_path / "rtde.csv", table, delimiter=",", header=header, comments="")
    result = inspect_log(tmp_path / "rtde.csv", ur)
    assert "actual_current" in sentences(result)["vendor_signal"]
    assert result.plan.torque is not None
    assert result.plan.torque.unit == "A"
    assert result.plan.torque.gain is None
    assert any(f.kind == "current_gains" for f in result.findings)


@pytest.mark.parametrize("factor", [0.5, 0.95])
def test_a_filter_of_the_positions_is_no_velocity(
    lib: Library, clean: Recording, saved, tmp_path: Path, factor: float
) -> None:
    """Property: the factor of a first-order filter is estimated to its noise, and the proposed
    recipe differentiates q.

    Positions have digits of 1e-6 rad; the regression of 1000 rows is exact to 1e-3.
    """
    q = np.round(clean.q, 6)
    slope = np.vstack([np.zeros(q.shape[1]), np.diff(q, axis=0) / np.diff(clean.t)[:, None]])
    late = lfilter([1 - factor], [1, -factor], slope, axis=0)
    log = saved(clean, q=q, dq=late)
    result = inspect_log(log, lib)
    finding = next(f for f in result.findings if f.kind == "velocity_filtered")
    assert np.allclose(finding.evidence["factor"], factor, atol=1e-3)
    step = np.median(np.diff(clean.t))
    assert abs(finding.evidence["lag_s"] - factor * step / (1 - factor)) < 0.1 * step / (1 - factor)
    assert result.plan.velocity is None
    require_no_warning(result, log, lib, tmp_path)


def test_measured_velocities_are_kept(lib: Library, clean: Recording) -> None:
    """Property: exact and noisy velocities are measurements; those of difference quotients without
    memory are hardly late.
    """
    rng = np.random.default_rng(0)
    plan = replace(read_from("tau", ""), velocity=Signal("rad/s", layout="npz", key="dq"))
    assert clean.dq is not None
    noisy = clean.dq + 1e-3 * rng.normal(size=clean.dq.shape)
    differences = np.gradient(clean.q, clean.t, axis=0)
    for dq in (clean.dq, noisy, differences):
        assert velocity_filter(clean.replace(dq=dq), plan, lib) == (plan, [])


def test_the_velocities_of_tiago(shared_data: Path) -> None:
    """Oracle: the filter that the maker's driver applies, a = 0.95 (spec of the data)."""
    folder = shared_data / "data" / "tiago"
    read = [np.genfromtxt(folder / f"tiago_{kind}.csv", delimiter=",", skip_header=1)
            for kind in ("position", "velocity")]  # fmt: skip
    q, dq = (each[2000:4000, 1:] for each in read)
    recording = Recording(t=read[0][2000:4000, 0], q=q, dq=dq)
    plan = replace(read_from("tau", ""), velocity=Signal("rad/s", layout="npz", key="dq"))
    names = type("Robot", (), {"joint_names": tuple(f"joint{j}" for j in range(8))})
    without, (finding,) = velocity_filter(recording, plan, names)  # type: ignore[arg-type]
    assert np.allclose(finding.evidence["factor"], 0.95, atol=2e-3)
    assert without.velocity is None
