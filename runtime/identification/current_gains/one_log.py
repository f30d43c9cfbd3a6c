"""Gains of motor currents from one log, with the URDF as prior of the links.

    i_j = c_j Y_j π + F_j ψ_j + e_j,    c_j = 1/k_j,    π ~ N(π0, R Rᵀ)

Friction ψ in A and c_j Y_j π are determined by the data; a common factor of all π and 1/c_j is not.
It comes from the prior, 25 % of every direction of the links' inertia, or from a weighed mass,
m = Σ m_k, and so do the gains of joints that share no parameters with the others. Residuals that
are correlated count by their density (`coloured_noise`). Source: the prior is that of map (Lee,
Wensing & Park 2019) to second order; Gautier & Briot 2014 for the scale by a known mass.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression.coloured_noise import coloured_noise_of_rows
from runtime.estimators.regression.recorded_delay import filtered
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.current_gains.gain_posterior import (
    covariance_of_gains,
    gain_rows,
    most_probable,
)
from runtime.library import Array, Library
from runtime.library.parameters import MASS, N_PARAMETERS
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.current_gains import (
    DETERMINED,
    LARGEST,
    OF_URDF,
    UNSEEN,
    UP_TO_FACTOR,
    CurrentGains,
)
from runtime.recording.friction import DRIVE, geared
from runtime.recording.preprocessing import prepare

MOST_ROWS, FEWEST = 1500, 100
"""Rows that are used, and fewest that suffice."""
WEAK = 10.0
"""Factor on the spread of the prior with which the data alone are asked for a gain."""
_SEEN = 5.0
"""c over its standard deviation below which a current shows no torque of the links."""
LEAST = 1e-6
"""Singular value of unit friction columns over the largest, below which a direction is absent."""


class Weighed(NamedTuple):
    """A mass from a scale.

    Attributes:
        kg: the mass.
        link: name of the link; None for all moving links together.
    """

    kg: float
    link: str | None = None

    def row(self, lib: Library) -> Array:
        """Coefficients of the mass in π, (10 n,)."""
        if not 0 < self.kg < np.inf:
            raise IdentificationError(f"a weighed mass must be above 0 kg, got {self.kg:g}")
        names = [joint.link for joint in lib.manifest.all_joints]
        row = np.zeros((lib.n_links, N_PARAMETERS))
        if self.link is None:
            row[:, MASS] = 1.0
        elif self.link in names:
            row[names.index(self.link), MASS] = 1.0
        else:
            raise IdentificationError(
                f"the robot has no moving link '{self.link}'; it has {', '.join(names)}"
            )
        return row.ravel()

    def phrase(self) -> str:
        """What fixes the scale."""
        what = "the moving links" if self.link is None else self.link
        return f"the mass of {what}, {self.kg:g} kg"


class _Rows(NamedTuple):
    """Channels with friction taken out.

    Attributes:
        base: A_j, (N, n, n_b).
        current: (N, n).
        basis: orthonormal friction columns of every channel, (N, n, k).
        sign: of k by the power k i dq, which friction takes over a motion, (n,).
    """

    base: Array
    current: Array
    basis: Array
    sign: Array


def current_gains(
    recording: Recording,
    lib: Library,
    weighed: Sequence[Weighed] = (),
    *,
    friction: Friction | None = None,
    preparation: Preparation | None = None,
) -> CurrentGains:
    """Estimate the gains of motor currents from one log."""
    rows, channels = _rows(recording, lib, friction or Friction(DRIVE), preparation)
    known = np.array([each.row(lib) for each in weighed]).reshape(-1, lib.n_links * N_PARAMETERS)
    kg = np.array([each.kg for each in weighed])
    reduced = gain_rows(rows.base, rows.current, lib, known, kg)
    z, c = most_probable(reduced)
    # The density of the noise weighs the data against the prior, and needs a first fit.
    density = _density(rows, lib.base_matrix @ (lib.pi0 + reduced.root @ z), c, reduced.noise(z, c))
    z, c = most_probable(reduced, z, density)
    spread, alone = (covariance_of_gains(reduced, z, c, density, each) for each in (1.0, WEAK))
    scale = " and ".join(each.phrase() for each in weighed) or "the masses of the URDF"
    return _gains(channels, c, rows.sign, spread, alone, scale)


def _rows(
    recording: Recording, lib: Library, terms: Friction, preparation: Preparation | None
) -> tuple[_Rows, tuple[str, ...]]:
    """Prepared rows of every channel, and the names of the channels."""
    bare = recording.replace(columns=None, column_names=(), motors=None)
    usual = filtered(recording, preparation or recording.preparation)
    done = prepare(bare, usual, geared(terms, bare, lib), lib=lib)
    if np.any(lib.known_torque(done.q)):
        raise IdentificationError(
            "gains of motor currents are not estimated with known springs or torque curves of the "
            "mechanism; write the gains into the recipe"
        )
    samples = samples_of(done, lib)
    if len(samples) < FEWEST:
        raise IdentificationError(
            f"expected {FEWEST} rows or more to estimate gains, got {len(samples)}; record for "
            "longer, or write the gains into the recipe"
        )
    samples = samples.rows(slice(None, None, max(1, len(samples) // MOST_ROWS)))
    R = np.array(recording.recipe.gear if recording.recipe else ())
    coupled = np.count_nonzero(R) > np.count_nonzero(np.diagonal(R)) if R.size else False
    to_channels = np.linalg.inv(R).T if coupled else np.eye(lib.n_joints)
    names = tuple(f"motor {m + 1}" for m in range(len(R))) if coupled else lib.joint_names
    return _without_friction(samples, lib, np.asarray(to_channels)), names


def _without_friction(samples: Samples, lib: Library, to_channels: Array) -> _Rows:
    base = np.einsum("mj,ijk->imk", to_channels, samples.base_rows(lib))
    friction = np.einsum("mj,ijk->imk", to_channels, samples.friction_rows())
    current = samples.tau @ to_channels.T
    speed = samples.dq @ np.linalg.inv(to_channels)
    sign = np.where(np.sum(speed * current, axis=0) < 0, -1.0, 1.0)
    n = lib.n_joints
    bases = []
    for j in range(n):
        columns = friction[:, j][:, friction[:, j].any(axis=0)]
        unit = columns / np.linalg.norm(columns, axis=0)
        left, sizes, _ = np.linalg.svd(unit, full_matrices=False)
        q = left[:, sizes > LEAST * sizes.max(initial=0.0)]
        base[:, j] -= q @ (q.T @ base[:, j])
        current[:, j] -= q @ (q.T @ current[:, j])
        bases.append(q)
    width = max(q.shape[1] for q in bases)
    basis = np.stack([np.pad(q, ((0, 0), (0, width - q.shape[1]))) for q in bases], axis=1)
    return _Rows(base, current, basis, sign)


def _density(rows: _Rows, beta: Array, c: Array, noise: Array) -> float:
    """Density of the residuals at the frequencies of the unknowns, over their variance."""
    model = rows.base @ beta
    along = model[:, :, None] * np.eye(len(c))
    n = len(c)
    friction = np.zeros((*model.shape, n, rows.basis.shape[2]))
    friction[:, range(n), range(n)] = rows.basis
    columns = np.concatenate(
        [c[:, None] * rows.base, along, friction.reshape(*model.shape, -1)], axis=2
    )
    present = np.linalg.norm(columns.reshape(-1, columns.shape[2]), axis=0) > 0
    rest = (rows.current - c * model) / noise
    return max(coloured_noise_of_rows(columns[:, :, present] / noise[:, None], rest).density, 1.0)


def _gains(
    channels: tuple[str, ...], c: Array, sign: Array, with_prior: Array, without: Array, scale: str
) -> CurrentGains:
    """Gains with verdicts from c and the two covariances of ln c."""
    share, alone = np.sqrt(np.diagonal(with_prior)), np.sqrt(np.diagonal(without))
    seen = share < 1 / _SEEN
    if not seen.any():
        raise IdentificationError(
            "the currents show no torque of the links in this motion, so that no gain can be "
            "estimated; record a motion that lifts the arm, or write the gains into the recipe"
        )
    reference = int(np.argmin(np.where(seen, share, np.inf)))
    r = without[reference]
    ratio = np.sqrt(np.maximum(np.diagonal(without) + r[reference] - 2 * r, 0.0))
    verdicts = tuple(
        UNSEEN
        if not seen[j]
        else DETERMINED
        if alone[j] <= LARGEST
        else UP_TO_FACTOR
        if ratio[j] <= LARGEST
        else OF_URDF
        for j in range(len(c))
    )
    gain = 1 / np.where(seen, c, 1.0)
    gain = np.where(seen, gain, sign * np.median(np.abs(gain[seen])))
    inverse = np.linalg.pinv(with_prior[np.ix_(seen, seen)])
    return CurrentGains(
        channels=channels,
        gain=gain,
        sigma=np.where(seen, share * np.abs(gain), np.nan),
        ratio_sigma=np.where(seen, ratio, np.nan),
        reference=reference,
        verdicts=verdicts,
        scale=scale,
        common_sigma=float(1 / np.sqrt(inverse.sum())),
    )
