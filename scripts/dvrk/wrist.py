"""Friction of the wrist of the PSM: how much of it one run has beside another.

τ = s τ_f + offset + stiffness q + rotor ddq     per joint, s the level of friction τ_f
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

from runtime.library import Array, Library
from scripts.dvrk.fits import CUTOFF, MOTION, RATE, ArmFit, log

WRIST = slice(3, 7)
PERIOD = 6.0
"""Of the motions, s."""


def _low_passed(values: Array, cutoff: float) -> Array:
    sos = butter(4, cutoff, fs=RATE, output="sos")
    return np.asarray(sosfiltfilt(sos, values, axis=0))


def published_wrist(
    lib: Library, data: Path, run: str, rows: Sequence[Mapping[str, Any]]
) -> tuple[Array, Array, Array]:
    """Relative errors of the published wrist on a run, and the level of its friction there.

    Both sides pass the same low-pass, as in `fits`.
    """
    recording = log(data, run)
    q, dq = _low_passed(recording.q, MOTION), _low_passed(recording.required("dq"), MOTION)
    ddq = np.gradient(dq, 1.0 / RATE, axis=0)
    friction, rest = np.zeros_like(q), np.zeros_like(q)
    for row in rows:
        to_x = np.array([row["of"].get(name, 0.0) for name in lib.joint_names])
        x, dx, ddx = q @ to_x, dq @ to_x, ddq @ to_x
        friction += (row["coulomb"] * np.sign(dx) + row["viscous"] * dx)[:, None] * to_x
        rest += (row["rotor"] * ddx + row["offset"] + row["stiffness"] * x)[:, None] * to_x
    inner = slice(round(RATE), -round(RATE))
    tau, friction, rest, q, ddq = (
        _low_passed(values, CUTOFF)[inner, WRIST]
        for values in (recording.required("tau"), friction, rest, q, ddq)
    )
    errors = np.linalg.norm(tau - friction - rest, axis=0) / np.linalg.norm(tau, axis=0)
    levels = _levels(tau, friction, q, ddq)
    length = round(PERIOD * RATE)
    parts = [slice(k, k + length) for k in range(0, len(tau) - length, length)]
    single = [_levels(tau[s], friction[s], q[s], ddq[s]) for s in parts]
    return errors, levels, np.std(single, axis=0, ddof=1)


def _levels(tau: Array, friction: Array, q: Array, ddq: Array) -> Array:
    """s of each joint, beside a free offset, stiffness and rotor."""
    levels = []
    for k in range(tau.shape[1]):
        columns = np.stack([friction[:, k], np.ones(len(tau)), q[:, k], ddq[:, k]], axis=1)
        levels.append(np.linalg.lstsq(columns, tau[:, k], rcond=None)[0][0])
    return np.array(levels)


def one_level(fit: ArmFit, seconds: float) -> tuple[float, Array, Array]:
    """One level of friction of the whole wrist and an offset per joint, of the first seconds."""
    phi = fit.phi.copy()
    phi[:, fit.columns.index("offset")] = 0.0
    friction = fit.test.friction(phi)
    others = fit.residual(phi) + friction  # τ minus the links
    wrist = friction.copy()
    wrist[:, : WRIST.start] = 0.0
    others -= friction - wrist
    n = others.shape[1]
    offsets = np.broadcast_to(np.eye(n), (len(others), n, n))
    columns = np.concatenate([wrist[:, :, None], offsets], axis=2)
    start, scale = slice(0, round(seconds * RATE)), 1.0 / fit.test.tau.std(axis=0)
    rows = (columns[start] * scale[:, None]).reshape(-1, n + 1)
    x = np.linalg.lstsq(rows, (others[start] * scale).ravel(), rcond=None)[0]
    change = x[1:] - fit.phi[:, fit.columns.index("offset")]
    return float(x[0]), change, np.asarray(others - columns @ x)
