"""Estimate of what the friction columns of a campaign depend on.

    min over θ = (delay, ln z_c, ln v_s, w) of ‖r(θ)‖²,   r the weighted residual of [Y_b F(θ)]

r contains a prior of friction that grows with the load: |τ| is the measured torque, so that where
friction outweighs the links its column is that of dry friction again.
Gauss–Newton: the columns ∂(F φ)/∂θ join the least squares, and their coefficients are the step
(variable projection). The waves of gears are found first, joint by joint: the w whose sine and
cosine take most of the residual.
Source: Golub & Pereyra 1973 (variable projection), Kaufman 1975.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from runtime.campaign.gear_friction import (
    FRICTION,
    LOAD,
    SPREAD,
    GearFriction,
    errors_of,
    prepared_columns,
)
from runtime.estimators.regression.samples import samples_of
from runtime.library import Array, Library
from runtime.recording import Preparation, Recording

LOWEST, HIGHEST, SPACING = 3.0, 40.0, 0.1
"""Waves per rad that are tried: below, gravity has such periods; the spacing is finer than the
width of a line, 2π over the range of a joint."""
LEAST_SHARE, LEAST_ROWS = 0.1, 50.0
"""Share of the residual that a ripple takes at least, and the same times the number of rows: noise
of N_eff ≈ N/2.5 rows yields 2 ln(tried) / N_eff."""
SEARCHES, ITERATIONS = 2, 4
LARGEST = np.array([2e-3, 0.5, 0.5, 0.3])
"""Largest step of delay [s], ln z_c, ln v_s and w [1/rad]: the columns are linear so far."""
PASSES = 3
"""Passes in which the weights of the joints follow their residuals."""
RANK_TOLERANCE = 1e-9


def gear_of(
    motions: Sequence[Recording], lib: Library, preparation: Preparation, start: GearFriction
) -> GearFriction:
    """Estimate delay, strokes, peak speeds and waves."""
    gear = _moved(start, _step(motions, lib, preparation, start)[0])
    for _ in range(SEARCHES):  # ripples that others have covered show once these are columns
        waves = _step(motions, lib, preparation, gear, searches_waves=True)[1]
        gear = replace(gear, waves=np.where(gear.waves > 0, gear.waves, waves))
    for _ in range(ITERATIONS):
        gear = _moved(gear, _step(motions, lib, preparation, gear)[0])
    return replace(gear, phi=_step(motions, lib, preparation, gear)[2])


def _moved(gear: GearFriction, step: Array) -> GearFriction:
    """The parameters after a step (n, 4), which is bounded."""
    delay, stroke, speed, waves = np.clip(step, -LARGEST, LARGEST).T
    return GearFriction(
        gear.delay + delay,
        gear.stroke * np.exp(stroke),
        gear.peak_speed * np.exp(speed),
        np.where(gear.waves > 0, gear.waves + waves, 0.0),
        gear.phi,
    )


def _step(
    motions: Sequence[Recording],
    lib: Library,
    preparation: Preparation,
    gear: GearFriction,
    searches_waves: bool = False,
) -> tuple[Array, Array, Array]:
    """Gauss–Newton step (n, 4), waves that the residual shows (n,), coefficients (n, 7).

    Waves are 0 where they are not searched.
    """
    parts = [prepared_columns(each, gear, preparation) for each in motions]
    samples = [samples_of(rows.replace(columns=None, column_names=()), lib) for *_, rows in parts]
    slopes = np.concatenate([each[1] for each in parts])
    q, tau = (np.concatenate([getattr(s, key) for s in samples]) for key in ("q", "tau"))
    base = np.concatenate([each.base_rows(lib) for each in samples])
    log_of_row = np.repeat(np.arange(len(parts)), [len(each) for each in samples])
    offsets = (log_of_row[:, None] == np.arange(len(parts))).astype(float)  # one per log and joint
    friction = np.concatenate([each[0] for each in parts])
    count, n, k = friction.shape
    apart = np.broadcast_to(offsets[:, None], (count, n, len(parts)))
    rows = np.concatenate([base, _spread(np.concatenate([friction, apart], axis=2))], axis=2)
    weight, phi, rest = np.ones(n), np.zeros((n, k)), tau
    basis = np.zeros((count * n, 0))
    known = np.zeros((n, rows.shape[2]))  # the prior of friction that grows with the load
    loads = base.shape[2] + FRICTION.index("dahl load") + (k + len(parts)) * np.arange(n)
    known[np.arange(n), loads] = 1 / LOAD
    for _ in range(PASSES):
        x, basis = _least_squares(rows * weight[:, None], tau * weight, known)
        phi = x[base.shape[2] :].reshape(n, -1)[:, :k]
        rest = tau - rows @ x
        weight = 1 / np.maximum(rest.std(axis=0), 1e-12)
    # Columns of the parameters without what the other columns explain, over σ of their prior.
    scale = np.tile(SPREAD, n)
    added = (_spread(errors_of(slopes, phi)) * weight[:, None]).reshape(count * n, -1) * scale
    added = added - basis @ (basis.T @ added)
    target = added.T @ (rest * weight).ravel()
    theta = scale * np.linalg.solve(np.eye(len(scale)) + added.T @ added, target)
    waves = _waves(q, rest * weight, basis) if searches_waves else np.zeros(n)
    return theta.reshape(n, len(SPREAD)), waves, phi


def _spread(columns: Array) -> Array:
    """Columns of joints (N, n, k) as rows over all coefficients, (N, n, n k)."""
    count, n, k = columns.shape
    rows = np.zeros((count, n, n, k))
    for j in range(n):
        rows[:, j, j] = columns[:, j]
    return rows.reshape(count, n, n * k)


def _least_squares(rows: Array, target: Array, known: Array) -> tuple[Array, Array]:
    """Solution of least norm over unit columns, and an orthonormal basis of the columns."""
    flat = np.concatenate([rows.reshape(-1, rows.shape[2]), known])
    lengths = np.linalg.norm(flat, axis=0)
    unit = flat / np.where(lengths > 0, lengths, 1.0)
    values, turn = np.linalg.eigh(unit.T @ unit)
    present = values > RANK_TOLERANCE * values[-1]
    basis = unit @ (turn[:, present] / np.sqrt(values[present]))
    basis = basis[: target.size]  # the prior expects zeros
    x = (turn[:, present] / np.sqrt(values[present])) @ (basis.T @ target.ravel())
    return x / np.where(lengths > 0, lengths, 1.0), basis


def _waves(q: Array, rest: Array, basis: Array) -> Array:
    """Waves per rad of the strongest ripple of every joint, 0 where there is none, (n,).

    The residual r explained by C = [sin wq, cos wq] beside the other columns is cᵀ G⁻¹ c with
    c = Cᵀ r and G = Cᵀ C − (Bᵀ C)ᵀ (Bᵀ C), B the orthonormal basis of these columns.
    """
    count, n = q.shape
    tried, waves = np.arange(LOWEST, HIGHEST, SPACING), np.zeros(n)
    by_joint = basis.reshape(count, n, -1)
    for j in range(n):
        angle = np.outer(q[:, j], tried)
        pair = np.sin(angle), np.cos(angle)
        known = [by_joint[:, j].T @ each for each in pair]
        on = [each.T @ rest[:, j] for each in pair]
        g = [[_dots(pair[a], pair[b]) - _dots(known[a], known[b]) for b in (0, 1)] for a in (0, 1)]
        least = 1e-3 * count  # what the other columns explain is absent
        size = np.maximum(g[0][0] * g[1][1] - g[0][1] ** 2, least**2)
        gained = g[1][1] * on[0] ** 2 - 2 * g[0][1] * on[0] * on[1] + g[0][0] * on[1] ** 2
        share = gained / size / float(rest[:, j] @ rest[:, j])
        best = int(np.argmax(share))
        if share[best] > max(LEAST_SHARE, LEAST_ROWS / count):
            waves[j] = tried[best]
    return waves


def _dots(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->j", a, b)
