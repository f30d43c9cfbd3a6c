"""Prepared and thinned rows on which the checks of the torque are computed.

The checks themselves are `torque_signs`, `gravity` and `model_fit`.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError
from runtime.estimators.regression.posterior import least_squares
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.friction.columns import ROTOR
from runtime.recording.friction.coupled_motors import spread
from runtime.recording.preprocessing import prepare
from runtime.recording.rest_speeds import rest_speeds

EPSILON = 0.05
"""Width of the smooth sign of dq, rad/s."""
ROWS = 900
"""Number of rows: some hundred of them are independent, and a fit of 100 unknowns takes 50 ms."""
FEWEST_ROWS, SLOWEST_HZ = 150, 20.0
"""Rows, and rate in Hz, below which accelerations mean nothing and no check is made."""
ROUGH_HZ = 5.0
"""Cut-off where the recipe has no filter, Hz."""
SHARE = 0.2
"""The same over the rate of the log, where the rate is low."""


@dataclass(frozen=True, slots=True, eq=False)
class TorqueRows:
    """Prepared rows of one recording."""

    lib: Library  # library of the robot
    whole: Recording  # the recording on its grid, filtered, not decimated and with its rests
    rows: NDArray[np.int64]  # indices of the thinned rows in which the arm moves, (N,)
    samples: Samples  # samples of these rows, with friction columns
    has_rotors: bool = False  # whether rotor inertia is among these columns

    def model_torque(self) -> tuple[Array, Array]:
        """Inertial and gravity part of the torque of the URDF at the rows, (N, n) each, N·m or
        N.
        """
        s, still = self.samples, np.zeros_like(self.samples.q)
        gravity = self.lib.inverse_dynamics(s.q, still, still, self.lib.pi0)
        return self.lib.inverse_dynamics(s.q, s.dq, s.ddq, self.lib.pi0) - gravity, gravity

    def friction_rows(self) -> Array:
        """Friction part of the equations over φ, (N n, n k), one block of columns per joint."""
        s = self.samples
        return spread(s.columns, s.coupling).reshape(len(s) * self.lib.n_joints, -1)


def torque_rows_of(
    recording: Recording, lib: Library, preparation: Preparation, terms: Friction
) -> TorqueRows:
    """Prepare a recording for the checks of its torque."""
    bare = recording.replace(columns=None, column_names=(), motors=None)
    usual = replace(preparation, rate_hz=None, rest_speed=None, regressor="acceleration")
    whole = prepare(bare, usual, terms, lib=lib)
    if whole.rate_hz < SLOWEST_HZ or len(whole) < FEWEST_ROWS:
        raise IdentificationError(
            f"expected {FEWEST_ROWS} rows or more at {SLOWEST_HZ:g} Hz or more, which "
            f"accelerations need, got {len(whole)} rows at {whole.rate_hz:.3g} Hz; record "
            "for longer or faster"
        )
    samples = samples_of(whole, lib)
    if lib.manifest.springs or "known_torque" in lib.manifest.kernels:
        samples = _without_springs(samples, lib) if lib.manifest.springs else samples
        whole = whole.replace(tau=samples.tau)
    moving = np.any(np.abs(samples.dq) >= rest_speeds(lib), axis=1)
    rows = np.flatnonzero(moving if moving.sum() > ROWS // 4 else np.ones(len(samples), dtype=bool))
    rows = rows[:: max(1, len(rows) // ROWS)]
    return TorqueRows(lib, whole, rows, samples.rows(rows), ROTOR.name in terms.columns)


def _without_springs(samples: Samples, lib: Library) -> Samples:
    """Samples less the torque of springs of unknown stiffness, τ − S k.

    k is that of least squares over [β; φ; k]; the checks compare the rest with the URDF's links.
    """
    springs = lib.spring_columns(samples.q)
    take = slice(None, None, max(1, len(samples) // ROWS))
    few = samples.rows(take)
    others = np.concatenate([few.base_rows(lib), few.friction_rows()], axis=2)
    others = others.reshape(-1, others.shape[2])
    target = np.concatenate([springs, samples.tau[..., None]], axis=2)[take]
    _, rest = least_squares(others, target.reshape(len(others), -1))
    k, _ = least_squares(rest[:, :-1], rest[:, -1])
    return replace(samples, tau=samples.tau - springs @ k)


def rough(recording: Recording, preparation: Preparation) -> Preparation:
    """Preparation with a low-pass for the checks, where the recipe has no filter."""
    if preparation.filter != "none":
        return preparation
    grid = preparation.max_gap_s
    step = 1.0 / recording.rate_hz
    uniform = float(np.abs(np.diff(recording.t) / step - 1.0).max()) < 0.01
    f_c = min(ROUGH_HZ, SHARE * recording.rate_hz)
    return replace(
        preparation,
        filter="butterworth",
        cutoff_hz=f_c,
        max_gap_s=grid if grid or uniform else 4.0 * step,
        trim_s=min(1.0 / f_c, 0.05 * recording.duration),
    )
