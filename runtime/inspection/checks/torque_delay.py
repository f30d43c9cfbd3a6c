"""Delay δ of the time stamps of τ: minimum over δ of ‖τ(t + δ) − W x‖.

Rows near a reversal of a joint's speed are left out for that joint: friction has a memory there and
lags behind the sign of dq, which looks like a delay of some 20 ms. A coarse search up to `LONGEST`
finds the valley, a fine one its bottom.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from runtime.estimators.regression.coloured_noise import coloured_noise_of_rows
from runtime.estimators.regression.posterior import orthonormal
from runtime.estimators.regression.samples import NORMAL_95
from runtime.inspection.checks.torque_rows import TorqueRows
from runtime.inspection.finding import INFO, WARNING, Finding
from runtime.library import Array
from runtime.recording import Recipe
from runtime.recording.preprocessing.segments import interpolate

LONGEST, SHARE = 1.0, 0.1
"""Largest delay that is searched [s], and its largest share of the duration."""
COARSE, FINE = 0.1, 0.01
"""Steps of the two searches, over the period of the cut-off: a quarter of it is the width of the
valley."""
NEAR = 0.1
"""Time around a reversal of the speed that is left out [s]."""
SLIDING = 0.1
"""Speed over the largest one of the joint, below which friction may not be sliding."""
LEAST_SHARE = 0.3
"""Least share of the rows that must remain; else all are used."""
SURE = 4.0
"""Standard deviations from which on a delay is significant."""
LATE_GAIN = 0.07
"""Share of the squared residual that a delay must explain; smaller ones change the result less than
the error of the friction model."""


def delay(
    torque_rows: TorqueRows, matrix: Array, plan: Recipe, *, has_gains: bool = True
) -> list[Finding]:
    """Delay of τ behind q."""
    whole = torque_rows.whole
    period = 1.0 / (plan.preparation.cutoff_hz or 5.0)
    reach = max(min(LONGEST, SHARE * whole.duration), 0.25 * period)
    step = 1.0 / whole.rate_hz
    search = _Search(torque_rows, matrix, reach, has_gains)
    coarse = np.arange(-reach, reach + COARSE * period / 2, COARSE * period)
    first = coarse[int(np.argmin([search.cost(d) for d in coarse]))]
    width = 1.5 * COARSE * period
    grid = np.arange(max(first - width, -reach), min(first + width, reach), FINE * period)
    cost = np.array([search.cost(d) for d in grid])
    k = int(np.argmin(cost))
    if not 0 < k < len(grid) - 1 or cost[k] <= 0:
        return [_stated(grid, cost, None, None)]
    # A parabola through the least value and its neighbours resolves fractions of a step.
    low, mid, high = cost[k - 1 : k + 2]
    curve = (low - 2 * mid + high) / (grid[1] - grid[0]) ** 2
    late = float(grid[k] - (high - low) / (2 * (grid[1] - grid[0]) * curve))
    gain = 1.0 - mid / search.cost(0.0)
    sigma = float(np.sqrt(2.0 * mid / curve / search.freedom(late)))
    stated = _stated(grid, cost, late, sigma)
    if gain < LATE_GAIN or abs(late) < SURE * sigma or abs(late) < 0.3 * step:
        return [stated]
    which = "later" if late > 0 else "earlier"
    return [
        Finding(
            "time_shift",
            WARNING,
            f"τ is stamped {1e3 * abs(late):.2f} ms {which} than q (± {1e3 * sigma:.2f} ms, "
            f"{abs(late) / step:.2g} samples; up to {reach:.2g} s were searched): shifting it back "
            f"removes {100 * gain:.0f} % of the squared residual; set torque_delay_s = {late:.2g} "
            "under [preparation]",
            {"delay_s": late, "sigma_s": sigma, "gain": gain, "searched_s": reach},
        ),
        stated,
    ]


def _stated(grid: Array, cost: Array, late: float | None, sigma: float | None) -> Finding:
    """Profile and interval of the delay as information, whether or not it is to be corrected."""
    evidence: dict[str, Any] = {
        "delay_s": late,
        "sigma_s": sigma,
        "profile": {"delay_s": [float(x) for x in grid], "loss": [float(x) for x in cost]},
    }
    if late is None or sigma is None:
        sentence = (
            "a delay of the measured torque is not determined: the loss has no minimum within "
            f"{1e3 * grid[0]:.0f} to {1e3 * grid[-1]:.0f} ms; record a faster motion to estimate it"
        )
        return Finding("delay", INFO, sentence, evidence)
    half = NORMAL_95 * sigma
    evidence["interval_s"] = [late - half, late + half]
    sentence = (
        f"the measured torque is stamped {1e3 * late:.1f} ms after the motion (95 % interval "
        f"{1e3 * (late - half):.1f} to {1e3 * (late + half):.1f} ms); friction with a memory looks "
        "like a delay of some ms"
    )
    return Finding("delay", INFO, sentence, evidence)


class _Search:
    """Weighted squared residual of the fit as a function of δ."""

    def __init__(
        self, torque_rows: TorqueRows, matrix: Array, reach: float, has_gains: bool
    ) -> None:
        """Rows whose shifted torque lies within the log for every |δ| ≤ reach."""
        self._whole, t = torque_rows.whole, torque_rows.whole.t[torque_rows.rows]
        self._tau = self._whole.required("tau")
        inside = (t - reach > self._whole.t[0]) & (t + reach < self._whole.t[-1])
        self._t, n = t[inside], self._tau.shape[1]
        keep = _sliding(torque_rows)[inside]
        enough = keep.mean(axis=0) > LEAST_SHARE
        self._keep = keep | ~enough
        rows = matrix.reshape(len(t), n, -1)[inside]
        rows = rows * self._keep[:, :, None]
        lengths = np.linalg.norm(rows.reshape(-1, rows.shape[2]), axis=0)
        self._rows = rows / np.where(lengths > 0, lengths, 1.0)
        # Joints with unknown gains share no parameters: one block each, else one for all.
        blocks = [np.arange(n)] if has_gains else [np.array([j]) for j in range(n)]
        self._bases = [
            (block, orthonormal(self._rows[:, block].reshape(-1, self._rows.shape[2])))
            for block in blocks
        ]
        power = self._rest(0.0).var(axis=0)
        self._weights = 1.0 / np.maximum(power, 1e-12 * power.max() + 1e-300)

    def _rest(self, shift: float) -> Array:
        moved = interpolate(self._t + shift, self._whole.t, self._tau)
        rest = moved * self._keep
        for block, basis in self._bases:
            target = rest[:, block].ravel()
            rest[:, block] = (target - basis @ (basis.T @ target)).reshape(-1, len(block))
        return np.asarray(rest)

    def cost(self, shift: float) -> float:
        """Squared residual for one δ [s]; joints are weighted by their residual without delay."""
        return float(np.sum(self._rest(shift) ** 2 @ self._weights))

    def freedom(self, shift: float) -> float:
        """Effective number of residuals."""
        scale = np.sqrt(self._weights)
        rows = self._rows * scale[:, None]
        inflation = coloured_noise_of_rows(rows, self._rest(shift) * scale).inflation
        return max(float(self._keep.sum()) / inflation - 1.0, 1.0)


def _sliding(torque_rows: TorqueRows) -> NDArray[np.bool_]:
    """Rows and joints far from a reversal of the speed, (N, n)."""
    dq, rate = torque_rows.whole.required("dq"), torque_rows.whole.rate_hz
    slow = np.abs(dq) < SLIDING * np.abs(dq).max(axis=0)
    width = 2 * round(NEAR * rate) + 1
    near = maximum_filter1d(slow.astype(np.uint8), width, axis=0, mode="nearest")
    return np.asarray(near[torque_rows.rows] == 0)
