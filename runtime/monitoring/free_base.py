"""Equations of a robot with a free base over all changes that are distinguished.

    Nᵀ ([0; τ] + Jᵀ w) = Nᵀ (Y π + [0; F φ]) + r,   columns of changes Nᵀ [0; h]

with N of `identification.free_base.rows`: a change of a torque sensor or of friction enters the
rows of the joints, and wrenches that were not measured are eliminated. Offsets of contact sensors,
and other errors of theirs within their σ, differ from log to log.

The rows have one covariance Σ of noise, that of an accelerometer enters many of them, and the
equations of an instant that of Nᵀ Σ N, by which they are divided. Σ is that of
expectation–maximisation, as in `identification.free_base.drives`.

A gain moves the torque that the model needs, not the measured one, whose noise is in the residual.
Where no wrench was measured all gains together are all masses together: the torques needed have to
satisfy the equations, Nᵀ [0; τ − δ] = Nᵀ [0; τ] − e, or the small difference of both columns is
noise of the residual itself.
"""

from dataclasses import replace

import numpy as np

from runtime.estimators.regression.coloured_noise import slow_cosines
from runtime.estimators.regression.samples import Samples
from runtime.identification.free_base.drives import covariance_after, rms
from runtime.identification.free_base.result import rows_by_result
from runtime.identification.free_base.rows import sensor_errors
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.library.free_base import FREEDOM
from runtime.monitoring import scores
from runtime.monitoring.model import model_of
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.friction.model import torque as friction_torque

LARGEST_SHARE = 0.5  # share of a measured torque that may be that of a wrong gain
LEAST = 1e-3  # noise of an equation relative to its size, at least
SMALL = 1e-2  # share of the torques in an equation below which they hardly enter it
PASSES, ENOUGH = 15, 1000  # passes of expectation–maximisation, and instants that they take


def free_changes_of(lib: Library, saved: SavedResult, log: FreeBaseRecording) -> scores.Changes:
    """Changes that logs as `log` show: those of bodies, and of torques where these are in rows."""
    none = np.zeros(0)
    if saved.record.rows == "base" or log.tau is None:
        return scores.Changes((), none, (), none)
    # Torque of other shapes is in the noise between blocks.
    return replace(scores.changes_of(lib, model_of(saved, lib), log.tau), ranges=none)


def free_changed_rows(
    lib: Library, saved: SavedResult, log: FreeBaseRecording, changes: scores.Changes, most: int
) -> scores.ChangedRows:
    """Equations of a log, low-passed as that of the result, at most `most` instants."""
    cutoff = saved.preparation.cutoff_hz
    motion, rows, phi = rows_by_result(log, lib, saved, cutoff, most)
    samples, errors = rows.samples, sensor_errors(motion.contacts)
    tau, base = samples.tau, samples.base_rows(lib)
    rest = tau - samples.rigid(lib, saved.pi) - samples.columns @ phi
    over = _over_noise(rows.basis, rest, LEAST * rms(tau))
    left = np.einsum("nlm,nm->nl", over, rest)
    named: Array = np.zeros((*tau.shape, 0))
    if changes.names and motion.tau is not None:
        friction = []
        if motion.friction is not None:
            changing = scores.changing_friction(model_of(saved, lib))
            friction = [friction_torque(motion.friction, each, None) for each in changing]
        in_torques = rows.basis[:, -lib.n_joints :]
        basis = over @ in_torques.swapaxes(1, 2)
        each = basis * motion.tau[:, None]
        share = np.einsum("nmj,nm->j", each, left) / np.sum(each**2, axis=(0, 1))
        # Torques without their visible noise, which would be in columns and residual. Of (1 + g) τ
        # a share s = g / (1 + g) is too much: without it a gain has its true size.
        # These are the least torques δ with Nᵀ [0; δ] = e where torques enter.
        across = in_torques.swapaxes(1, 2) @ in_torques + SMALL**2 * np.eye(in_torques.shape[2])
        visible = np.linalg.solve(across, rest[..., None])[..., 0]
        by_model = motion.tau - np.einsum("njm,nm->nj", in_torques, visible)
        sizes = np.sum(motion.tau**2, axis=0) / np.sum(motion.tau * by_model, axis=0)
        by_model *= sizes * (1 - share.clip(-LARGEST_SHARE, LARGEST_SHARE))
        named = np.einsum("nmj,njc->nmc", basis, scores.named_columns(motion.t, by_model, friction))
    spread = samples.columns[:, :, : len(errors)] * np.array([sigma for _, sigma in errors])
    of_drives = samples.columns[:, :, len(errors) :]
    joints = slice(FREEDOM, None)
    moved = Samples(motion.q[:, joints], motion.dq[:, joints], None, tau, samples.columns)
    return scores.ChangedRows(
        motion.t,
        left,
        scores.error_percent(rest, tau),
        np.concatenate([named, over @ base], axis=2),
        over @ np.concatenate([base, of_drives], axis=2),
        np.zeros((*tau.shape, 0)),
        # Noise of an accelerometer is in the columns at all frequencies.
        slow_cosines(moved, least_hz=0.0),
        scores.low_pass_inflation(cutoff, motion.t),
        sessions=over @ np.concatenate([rows.offsets, spread], axis=2),
    )


def _over_noise(basis: Array, rest: Array, least: Array) -> Array:
    """W (N, m, m) with W e of covariance 1, for e = Nᵀ r (N, m), by the basis N (N, k, m).

    least (m,) is noise of every equation.
    """
    some = slice(None, None, max(1, len(rest) // ENOUGH))
    few, seen, floor = basis[some], rest[some], np.diag(np.maximum(least, 1e-150) ** 2)
    sigma = rms(np.einsum("nkm,nm->nk", few, seen)) + float(least.max())
    covariance = np.diag(np.maximum(sigma, 1e-150) ** 2)
    for _ in range(PASSES):
        covariance = covariance_after(covariance, few, seen, floor)
    spread = basis.swapaxes(1, 2) @ covariance @ basis + floor
    return np.asarray(np.linalg.inv(np.linalg.cholesky(spread)))
