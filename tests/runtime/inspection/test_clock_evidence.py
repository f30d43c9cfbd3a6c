"""Evidence for a rebuilt clock: Δq = v Δt with the mean v of both ends, exact at constant ddq."""

import numpy as np

from runtime.inspection import inspect_log
from runtime.library import Library
from runtime.recording import Preparation, Recipe
from runtime.recording.recipes.recipe import Signal, Time


def test_constant_acceleration_fits_the_rebuilt_clock_exactly(lib: Library, saved, clean) -> None:
    """Oracle: Δq = (v + v') Δt / 2 holds to rounding; the velocity of one end errs by ddq Δt/2.

    The logger repeats every tenth state, so that on the logged clock a tenth of the steps is empty.
    """
    ticks = np.arange(1500)
    kept = ticks[ticks % 10 != 9]
    rows = np.repeat(kept, np.where(kept % 10 == 8, 2, 1))  # the state before fills the gap
    t = 1e-3 * np.arange(len(rows))
    way = 1e-3 * rows[:, None] * np.ones(7)
    acceleration = np.array([0.2, -0.1, 0.15, 0.2, 0.3, 0.2, 0.1])
    start = 0.05 * np.sign(acceleration)
    q = lib.home + start * way + acceleration * way**2 / 2
    dq = start + acceleration * way
    tau = lib.inverse_dynamics(q, dq, np.broadcast_to(acceleration, q.shape), lib.pi0)
    result = inspect_log(saved(clean, t=t, q=q, dq=dq, tau=tau), lib)
    (evidence,) = (f.evidence for f in result.findings if f.kind == "repeated_rows")
    assert evidence["count"] == 150
    assert evidence["tick_s"] == 1e-3
    assert evidence["misfit_logged"] > 0.1
    # Rounding of q to 1e-16 over steps of 5e-5; the velocity of one end would leave 1e-4 and more.
    assert evidence["misfit_rebuilt"] < 1e-10


def test_noise_is_no_delay(double: Library, tmp_path) -> None:
    """Property: stamps without error and noise up to 0.8 of the Nyquist frequency; interpolation
    that averages rows would find half a sample.
    """
    t = np.arange(3000) / 200.0
    angle = t[:, None] * [1.3, 2.1]
    q, dq, ddq = np.sin(angle), np.cos(angle) * [1.3, 2.1], -np.sin(angle) * [1.69, 4.41]
    tau = double.inverse_dynamics(q, dq, ddq, double.pi0) + 0.1 * dq
    size = 0.01 * float(np.sqrt(np.mean(tau**2)))
    noise = np.random.default_rng(0).normal(0.0, size, tau.shape)
    np.savez(tmp_path / "log.npz", t=t, q=q, dq=dq, tau=tau + noise)
    preparation = Preparation(filter="butterworth", cutoff_hz=80.0)
    recipe = Recipe(
        time=Time(unit="s", layout="npz", key="t"),
        position=Signal("rad", layout="npz", key="q"),
        velocity=Signal("rad/s", layout="npz", key="dq"),
        torque=Signal("N*m", layout="npz", key="tau"),
        preparation=preparation,
    )
    findings = inspect_log(tmp_path / "log.npz", double, recipe).findings
    assert "time_shift" not in [f.kind for f in findings]
    (stated,) = (f.evidence for f in findings if f.kind == "delay")
    first, last = stated["interval_s"]
    assert first - stated["sigma_s"] < 0.0 < last + stated["sigma_s"]
