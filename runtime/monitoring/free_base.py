"""Equations of a robot with a free base over all changes that are distinguished.

    Nᵀ ([0; τ] + Jᵀ w) = Nᵀ (Y π + [0; F φ]) + r,   columns of changes Nᵀ [0; h]

with N of `identification.free_base.rows`: a change of a torque sensor or of friction enters the
rows of the joints, and wrenches that were not measured are eliminated. Offsets of contact sensors,
and other errors of theirs within their σ, differ from log to log.
"""

from dataclasses import replace

import numpy as np

from runtime.estimators.regression.coloured_noise import slow_cosines
from runtime.estimators.regression.samples import Samples
from runtime.identification.free_base.drives import rms
from runtime.identification.free_base.result import rows_by_result
from runtime.identification.free_base.rows import sensor_errors
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.library.free_base import FREEDOM
from runtime.monitoring.model import model_of
from runtime.monitoring.scores import (
    ChangedRows,
    Changes,
    changes_of,
    changing_friction,
    error_percent,
    low_pass_inflation,
    named_columns,
)
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.friction.model import torque as friction_torque

LARGEST_SHARE = 0.5
"""Share of a measured torque that may be that of a wrong gain."""
LEAST = 1e-3
"""Noise of a row relative to its size, at least."""


def free_changes_of(lib: Library, saved: SavedResult, log: FreeBaseRecording) -> Changes:
    """Changes that logs as `log` show: those of bodies, and of torques where these are in rows."""
    none = np.zeros(0)
    if saved.record.rows == "base" or log.tau is None:
        return Changes((), none, (), none)
    # Torque of other shapes is in the noise between blocks.
    return replace(changes_of(lib, model_of(saved, lib), log.tau), ranges=none)


def free_changed_rows(
    lib: Library, saved: SavedResult, log: FreeBaseRecording, changes: Changes, most: int
) -> ChangedRows:
    """Equations of a log, low-passed as that of the result, at most `most` instants."""
    cutoff = saved.preparation.cutoff_hz
    motion, rows, phi, _ = rows_by_result(log, lib, saved, cutoff, most)
    samples, errors = rows.samples, sensor_errors(motion.contacts)
    tau, base = samples.tau, samples.base_rows(lib)
    rest = tau - samples.rigid(lib, saved.pi) - samples.columns @ phi
    over = 1.0 / np.maximum(np.maximum(rms(rest), LEAST * rms(tau)), 1e-300)
    named: Array = np.zeros((*tau.shape, 0))
    if changes.names and motion.tau is not None:
        friction = []
        if motion.friction is not None:
            changing = changing_friction(model_of(saved, lib))
            friction = [friction_torque(motion.friction, each, None) for each in changing]
        basis = rows.basis[:, -lib.n_joints :] * over
        each = basis.transpose(0, 2, 1) * motion.tau[:, None]
        share = np.einsum("nmj,nm->j", each, rest * over) / np.sum(each**2, axis=(0, 1))
        # Torques without their visible noise, which would be in columns and residual. Of (1 + g) τ
        # a share s = g / (1 + g) is too much: without it a gain has its true size.
        by_model = motion.tau - rows.over_rows(rest)[:, -lib.n_joints :]
        sizes = np.sum(motion.tau**2, axis=0) / np.sum(motion.tau * by_model, axis=0)
        by_model *= sizes * (1 - share.clip(-LARGEST_SHARE, LARGEST_SHARE))
        named = np.einsum("njm,njc->nmc", basis, named_columns(motion.t, by_model, friction))
    spread = samples.columns[:, :, : len(errors)] * np.array([sigma for _, sigma in errors])
    sessions = np.concatenate([rows.offsets, spread], axis=2)
    of_drives = samples.columns[:, :, len(errors) :]
    joints = slice(FREEDOM, None)
    moved = Samples(motion.q[:, joints], motion.dq[:, joints], None, tau, samples.columns)
    return ChangedRows(
        motion.t,
        rest * over,
        error_percent(rest, tau),
        np.concatenate([named, base * over[:, None]], axis=2),
        np.concatenate([base, of_drives], axis=2) * over[:, None],
        np.zeros((*tau.shape, 0)),
        slow_cosines(moved),
        low_pass_inflation(cutoff, motion.t),
        sessions=sessions * over[:, None],
    )
