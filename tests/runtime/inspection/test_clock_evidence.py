"""Evidence for a rebuilt clock: Δq = v Δt with the mean v of both ends, exact at constant ddq."""

import numpy as np

from runtime.inspection import inspect_log
from runtime.library import Library


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
