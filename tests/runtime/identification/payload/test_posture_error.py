"""Torque that returns with the posture and differs between the empty and the loaded run."""

import numpy as np
import pytest

from runtime import Recording, identify_payload
from runtime.errors import RuntimeFault
from runtime.estimators.regression.samples import NORMAL_95
from runtime.identification.payload.arm_error import posture_error
from runtime.identification.payload.body import Payload
from runtime.library import Library

BALL = np.array([0.5, 0, 0, 0.05, 0.01, 0.01, 0.002, 0, 0, 0])
"""0.5 kg, its centre at 0.1 m [kg, kg·m ×3, kg·m² ×6]."""
NOISE = 0.01
"""[N·m]."""


def recorded(lib: Library, seed: int, stop: float) -> tuple[Recording, Recording]:
    """Loaded and empty run of five periods, whose loaded one meets a stop.

    Args:
        lib: arm of two joints.
        seed: of the noise.
        stop: stiffness of the stop beyond 0.4 rad of the first joint [N·m/rad].
    """
    t = np.arange(1000) / 50.0
    angle = 2 * np.pi * t[:, None] / 4.0 * np.array([1.0, 2.0])
    wave, rate = np.array([0.8, 0.5]), 2 * np.pi / 4.0 * np.array([1.0, 2.0])
    q, dq = wave * np.sin(angle), wave * rate * np.cos(angle)
    ddq = -wave * rate**2 * np.sin(angle)
    noise = np.random.default_rng(seed).normal(0.0, NOISE, (2, *q.shape))
    empty = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + noise[0]
    loaded = empty - noise[0] + noise[1] + lib.regressor(q, dq, ddq)[:, :, -10:] @ BALL
    loaded[:, 0] -= stop * np.maximum(q[:, 0] - 0.4, 0.0)
    return Recording(t, q, dq, ddq, loaded), Recording(t, q, dq, ddq, empty)


def identified(lib: Library, seed: int, stop: float) -> Payload:
    """Payload by the difference of both runs, of exact gains."""
    loaded, empty = recorded(lib, seed, stop)
    return identify_payload(loaded, lib, empty=empty, gain_error=0.0)


def test_exchanged_runs_are_refused(double: Library) -> None:
    """Oracle: the difference of exchanged runs is that of −0.5 kg."""
    loaded, empty = recorded(double, 0, 0.0)
    with pytest.raises(RuntimeFault, match="negative mass"):
        identify_payload(empty, double, empty=loaded)


def test_the_determined_moment_is_stated(double: Library) -> None:
    """Oracle: 0.5 kg at 0.1 m along z is 0.05 kg·m."""
    note = next(n for n in identified(double, 0, 0.0).notes if "mass × lever" in n)
    size = float(note.split(": ")[1].split()[0])
    assert size == pytest.approx(0.05, rel=0.1)
    assert "0.00, 1.00) of fore" in note


def test_a_mass_within_the_errors_of_postures_is_not_determined(double: Library) -> None:
    """Property: a stop whose σ is large for five groups is no absence of a payload.

    3 σ of a normal distribution are 4.67 of one that five groups know.
    """
    result = identified(double, 0, -3.0)
    assert 3 < result.body.mass / result.body.sigma[0] < 4.67
    assert result.status.startswith("mass not determined: errors that repeat with the position")


@pytest.mark.parametrize("seed", range(3))
def test_intervals_contain_what_a_posture_adds(double: Library, seed: int) -> None:
    """Property: the true mass is within the interval, which noise alone leaves by far.

    Without the stop there is no note, and the interval is that of the noise.
    """
    result = identified(double, seed, 2.0)
    off, sigma = result.body.mass - BALL[0], result.body.sigma[0]
    assert any("errors that repeat with the position of" in note for note in result.notes)
    assert abs(off) < NORMAL_95 * sigma
    assert abs(off) > 5 * result.white.sigma[0]
    clean = identified(double, seed, 0.0)
    assert not any("repeat with the position" in note for note in clean.notes)
    assert abs(clean.body.mass - BALL[0]) < 3 * clean.body.sigma[0] < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_what_is_not_sure_counts_and_is_not_said(double: Library, seed: int) -> None:
    """Property: a small stop moves the mass by more than 10 σ of the noise, within the interval."""
    result = identified(double, seed, -0.2)
    off = abs(result.body.mass - BALL[0])
    assert 10 * result.white.sigma[0] < off < NORMAL_95 * result.body.sigma[0]
    assert not any("repeat with the position" in note for note in result.notes)


def with_rests(lib: Library, seed: int, held: float) -> Payload:
    """Payload of steps between ten postures with rests, where friction holds a share of it."""
    rng = np.random.default_rng(seed)
    s = np.minimum(np.arange(50) / 30.0, 1.0)[:, None]  # 0.6 s of motion, 0.4 s of rest
    places, rate = rng.uniform(-1.5, 1.5, (11, 2)), 1 / 0.6
    steps = np.diff(places, axis=0)[:, None]
    q = (places[:-1, None] + steps * s**3 * (10 - 15 * s + 6 * s**2)).reshape(-1, 2)
    dq = (steps * 30 * rate * s**2 * (1 - s) ** 2).reshape(-1, 2)
    ddq = (steps * 60 * rate**2 * s * (1 - s) * (1 - 2 * s)).reshape(-1, 2)
    noise = rng.normal(0.0, NOISE, (2, *q.shape))
    empty, t = lib.inverse_dynamics(q, dq, ddq, lib.pi0), np.arange(len(q)) / 50.0
    load = lib.regressor(q, dq, ddq)[:, :, -10:] @ BALL
    loaded = empty + load * np.where(np.abs(dq) < 0.02, 1.0 - held, 1.0)
    runs = [
        Recording(t, q, dq, ddq, tau + e) for tau, e in zip((loaded, empty), noise, strict=True)
    ]
    return identify_payload(runs[0], lib, empty=runs[1], gain_error=0.0)


def test_what_friction_holds_of_the_payload_at_rest_is_left_out(double: Library) -> None:
    """Monte Carlo: mass, and centre along the arm, by their σ; friction holds 30 % of the torque.

    40 values know their root mean square to 11 %. With the rests the mass is 26 g too small.
    """
    found = [with_rests(double, seed, 0.3) for seed in range(40)]
    errors = np.array(
        [(each.body.values - [0.5, 0, 0, 0.1, *[0] * 6])[[0, 3]] / each.body.sigma[[0, 3]]
         for each in found]
    )  # fmt: skip
    assert np.all(np.abs(np.sqrt(np.mean(errors**2, axis=0)) - 1.0) < 0.33)
    assert all(500 * 0.5 < each.n_samples < 500 * 0.65 for each in found)
    assert np.mean([each.body.sigma[0] for each in found]) < 0.01


def test_changes_are_those_of_fits_without_a_part(double: Library) -> None:
    """Oracle: least squares without the rows of each fifth of the range of a joint."""
    rng = np.random.default_rng(1)
    t = np.arange(500) / 50.0
    q = np.stack([np.sin(t), np.zeros(500)], axis=1)
    rows, target = rng.normal(size=(500, 2, 10)), rng.normal(size=(500, 2))
    target[:, 0] += 30 * np.maximum(q[:, 0], 0.5) * rows[:, 0, 0]

    def fit(kept: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(rows[kept].reshape(-1, 10), target[kept].ravel(), rcond=None)[0]

    whole = fit(np.ones(500, dtype=bool))
    shape = np.linalg.inv(np.einsum("nij,nik->jk", rows, rows))
    found = posture_error(
        Recording(t, q), double.joint_names, rows, target - rows @ whole, shape, shape
    )
    assert found is not None
    assert found.joint == double.joint_names[0]  # the other one does not move
    place = np.argsort(np.argsort(q[:, 0])) * 5 // 500
    changes = np.array([fit(place != k) for k in range(5)])
    # 2.776 of Student's t with 4 degrees of freedom instead of 1.96.
    expected = np.maximum(
        2.776445 / 1.959964 * np.sqrt(4 * changes.var(axis=0) / np.diag(shape)), 1
    )
    # Seven digits of the quantiles.
    np.testing.assert_allclose(found.factors, expected, rtol=1e-6)
