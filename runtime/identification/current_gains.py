"""Gains of motor currents from one log, with the URDF as prior of the links.

    i_j = c_j Y_j π + F_j ψ_j + e_j,    c_j = 1/k_j,    π ~ N(π0, R Rᵀ)

Friction ψ in A and c_j Y_j π are determined by the data; a common factor of all π and 1/c_j is not.
It comes from the prior, 25 % of every direction of the links' inertia, or from a weighed mass,
m = Σ m_k, and so do the gains of joints that share no parameters with the others. Residuals that
are correlated count by their density (`coloured_noise`). With friction eliminated from A_j and the
links as nuisance parameters,

    i_j = c_j A_j K (π0 + R z) + e_j,    z ~ N(0, 1)

on one triangle per channel, solved by Gauss–Newton. Source: the prior is that of map (Lee, Wensing
& Park 2019) to second order; Gautier & Briot 2014 for the scale by a known mass.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD, bodies_of, prior_of
from runtime.estimators.gauss_newton import Linearised, gauss_newton
from runtime.estimators.regression.coloured_noise import coloured_noise_of_rows
from runtime.estimators.regression.posterior import APART, orthonormal, posterior_of
from runtime.estimators.regression.recorded_delay import filtered
from runtime.estimators.regression.samples import samples_of
from runtime.identification.settings import Settings
from runtime.library import Array, Library
from runtime.library.parameters import MASS, N_PARAMETERS
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording import current_gains as currents
from runtime.recording.friction.coupled_motors import geared
from runtime.recording.friction.model import DRIVE
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import before_test
from runtime.recording.unit_conversion import scaled

SCALE = 2e-3  # relative standard deviation of a scale
_PASSES, _HALVINGS = 60, 12
_CLOSE = 1e-3  # step of z, in standard deviations of the prior, at which the passes end
MOST_ROWS, FEWEST_ROWS = 1500, 100  # rows that are used, and fewest that suffice
WEAK = 10.0  # factor on the spread of the prior with which the data alone are asked for a gain
_SEEN = 5.0  # c over its standard deviation below which a current shows no torque of the links


@dataclass(frozen=True, slots=True)
class GainRows:
    """Rows of every channel and of the masses over z, with π = π0 + R z."""

    slopes: Array  # ∂(A_j K π)/∂z on the triangle of the channel, (n, r, w)
    model: Array  # A_j K π0 on it, (n, r)
    current: Array  # (n, r)
    root: Array  # R, (10 n, w)
    known: Array  # rows of the weighed masses over z in units of their σ, (m, w)
    surplus: Array  # weighed masses less those of the URDF, over σ, (m,)
    count: int  # number of samples

    @property
    def width(self) -> int:
        """Number w of directions of the prior."""
        return int(self.slopes.shape[2])

    def torque(self, z: Array) -> Array:
        """A_j K (π0 + R z) on the triangles, (n, r)."""
        return np.asarray(self.model + self.slopes @ z)

    def inverse_gains(self, z: Array) -> Array:
        """c of least squares at π = π0 + R z, (n,) [A/(N·m)]."""
        model = self.torque(z)
        both = np.sum(model * self.current, axis=1)
        return np.asarray(both / np.maximum(np.sum(model**2, axis=1), 1e-300))

    def noise(self, z: Array, c: Array) -> Array:
        """Residual RMS of the channels: z (w,), c (n,) [A/(N·m)] → (n,) [A]."""
        rest = self.current - c[:, None] * self.torque(z)
        return np.asarray(np.sqrt(np.sum(rest**2, axis=1) / self.count))

    def rest(self, z: Array, c: Array, unit: Array) -> Array:
        """Residuals of channels, prior and masses, over their noise, (n r + w + m,)."""
        current = (self.current - c[:, None] * self.torque(z)) / unit[:, None]
        return np.concatenate([current.ravel(), -z, self.surplus - self.known @ z])

    def jacobian(self, z: Array, c: Array, unit: Array) -> Array:
        """Derivative of the fitted values by (z, ln |c|), over the noise, (·, w + n)."""
        n, r, w = self.slopes.shape
        scale = (c / unit)[:, None]
        over_z = (scale[:, :, None] * self.slopes).reshape(n * r, w)
        along = block_diag(*(scale * self.torque(z))[:, :, None])
        further = np.vstack([np.eye(w), self.known])
        return np.block([[over_z, along], [further, np.zeros((len(further), n))]])


def most_probable(
    reduced: GainRows, z: Array | None = None, density: float = 1.0
) -> tuple[Array, Array]:
    """Most probable c with z integrated out, and z there, (w,).

        min ½ ‖rest(z, c)‖² + ½ log det H(c),    H = ∂²/∂z² of the first term

    The mode in (z, c) alone makes c too large: π = π0 + R z is longer than π0 in every direction
    that the data determine. ∂/∂ ln c_j of the second term is the number d_j of directions that
    channel j determines (MacKay 2003, Ch. 27). Gauss–Newton on z, with c eliminated (variable
    projection, Kaufman 1975) and with the noise of the present residuals.
    """
    w = reduced.width

    def linearise(z: Array) -> Linearised:
        c = reduced.inverse_gains(z)
        unit = reduced.noise(z, c) * np.sqrt(density)
        J, rest = reduced.jacobian(z, c, unit), reduced.rest(z, c, unit)
        model = reduced.torque(z)
        # Directions of z that each channel determines: d_j = tr(H⁻¹ c_j² G_jᵀG_j), (n,).
        rows = reduced.slopes * (c / unit)[:, None, None]
        grams = np.swapaxes(rows, 1, 2) @ rows
        H = np.eye(w) + reduced.known.T @ reduced.known + grams.sum(axis=0)
        directions = np.trace(np.linalg.solve(H, grams), axis1=1, axis2=2)
        longer = np.sum(model[:, None] @ reduced.slopes, axis=1)
        pull = (directions / np.maximum(np.sum(model**2, axis=1), 1e-300)) @ longer
        along, J = J[:, w:], J[:, :w]
        along = along / np.maximum(np.linalg.norm(along, axis=0), 1e-300)
        free = J - along @ (along.T @ J)

        def cost(z: Array) -> float:
            c = reduced.inverse_gains(z)
            rest = reduced.rest(z, c, unit)
            return float(rest @ rest / 2 + directions @ np.log(np.maximum(np.abs(c), 1e-300)))

        step = np.linalg.solve(free.T @ free, J.T @ rest + pull)
        return Linearised(step, np.ones(w), cost, order=2)

    start = np.zeros(w) if z is None else z
    z = gauss_newton(linearise, start, passes=_PASSES, done=_CLOSE, halvings=_HALVINGS).x
    return z, reduced.inverse_gains(z)


@dataclass(frozen=True, slots=True)
class Weighed:
    """A mass from a scale."""

    kg: float  # the mass
    link: str | None = None  # name of the link; None for all moving links together

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
        """Assumption that fixes the scale."""
        what = "the moving links" if self.link is None else self.link
        return f"the mass of {what}, {self.kg:g} kg"


@dataclass(frozen=True, slots=True, eq=False)
class _Channels:
    """Rows of the channels with friction eliminated."""

    base: Array  # A_j, (N, n, n_b)
    current: Array  # (N, n)
    basis: Array  # orthonormal friction columns of every channel, (N, n, k)
    sign: Array  # of k by the power k i dq, which friction takes over a motion, (n,)


def current_gains(
    recording: Recording,
    lib: Library,
    weighed: Sequence[Weighed] = (),
    *,
    friction: Friction | None = None,
    preparation: Preparation | None = None,
) -> currents.CurrentGains:
    """Estimate the gains of motor currents from one log."""
    rows, channels = _rows(recording, lib, friction or Friction(DRIVE), preparation)
    known = np.array([each.row(lib) for each in weighed]).reshape(-1, lib.n_links * N_PARAMETERS)
    kg = np.array([each.kg for each in weighed])
    # One triangle per channel, over z with π = π0 + R z.
    spread_of_links = bodies_of(lib).spread(prior_of(lib, lib.pi0).centre) / np.sqrt(CAD)
    root = np.asarray(block_diag(*spread_of_links))
    whole = np.concatenate([rows.base, rows.current[:, :, None]], axis=2).swapaxes(0, 1)
    triangles = np.asarray(np.linalg.qr(whole, mode="r"))
    reduced = GainRows(
        slopes=triangles[:, :, :-1] @ (lib.base_matrix @ root),
        model=triangles[:, :, :-1] @ (lib.base_matrix @ lib.pi0),
        current=triangles[:, :, -1],
        root=root,
        known=known @ root / (SCALE * kg)[:, None],
        surplus=(kg - known @ lib.pi0) / (SCALE * kg),
        count=len(rows.base),
    )
    z, c = most_probable(reduced)
    # The density of the noise weighs the data against the prior, and needs a first fit.
    density = _density(rows, lib.base_matrix @ (lib.pi0 + reduced.root @ z), c, reduced.noise(z, c))
    z, c = most_probable(reduced, z, density)
    # Covariance of ln |c| with the prior, and with one of `WEAK` times its spread.
    J, n = reduced.jacobian(z, c, reduced.noise(z, c) * np.sqrt(density)), len(c)
    spread, first = posterior_of(J).covariance[-n:, -n:], reduced.current.size
    J[first : first + reduced.width] /= WEAK
    alone = posterior_of(J).covariance[-n:, -n:]
    scale = " and ".join(each.phrase() for each in weighed) or "the masses of the URDF"
    return _gains(channels, c, rows.sign, spread, alone, scale)


def _rows(
    recording: Recording, lib: Library, terms: Friction, preparation: Preparation | None
) -> tuple[_Channels, tuple[str, ...]]:
    """Prepared rows of every channel without their part along friction, and names of channels."""
    bare = recording.replace(columns=None, column_names=(), motors=None)
    usual = filtered(recording, preparation or recording.preparation)
    done = prepare(bare, usual, geared(terms, bare, lib), lib=lib)
    if np.any(lib.known_torque(done.q)):
        raise IdentificationError(
            "gains of motor currents are not estimated with known springs or torque curves of the "
            "mechanism; write the gains into the recipe"
        )
    samples = samples_of(done, lib)
    if len(samples) < FEWEST_ROWS:
        raise IdentificationError(
            f"expected {FEWEST_ROWS} rows or more to estimate gains, got {len(samples)}; record "
            "for longer, or write the gains into the recipe"
        )
    samples = samples.rows(slice(None, None, max(1, len(samples) // MOST_ROWS)))
    to_channels, names = channels_of(recording, lib)
    base = np.einsum("mj,ijk->imk", to_channels, samples.base_rows(lib))
    friction = np.einsum("mj,ijk->imk", to_channels, samples.friction_rows())
    current, speed = samples.tau @ to_channels.T, samples.dq @ np.linalg.inv(to_channels)
    sign = np.where(np.sum(speed * current, axis=0) < 0, -1.0, 1.0)
    bases = [orthonormal(friction[:, j], APART) for j in range(lib.n_joints)]
    for j, q in enumerate(bases):
        base[:, j] -= q @ (q.T @ base[:, j])
        current[:, j] -= q @ (q.T @ current[:, j])
    width = max(q.shape[1] for q in bases)
    basis = np.stack([np.pad(q, ((0, 0), (0, width - q.shape[1]))) for q in bases], axis=1)
    return _Channels(base, current, basis, sign), names


def channels_of(recording: Recording, lib: Library) -> tuple[Array, tuple[str, ...]]:
    """R⁻ᵀ of τ_m = R⁻ᵀ τ where the gear couples joints, else 1, (n, n), and names of channels."""
    R = np.array(recording.recipe.gear if recording.recipe else ())
    if not R.size or np.count_nonzero(R) == np.count_nonzero(np.diagonal(R)):
        return np.eye(lib.n_joints), lib.joint_names
    return np.asarray(np.linalg.inv(R).T), tuple(f"motor {m + 1}" for m in range(len(R)))


def _density(rows: _Channels, beta: Array, c: Array, noise: Array) -> float:
    """Density of the residuals at the frequencies of the unknowns, over their variance."""
    model = rows.base @ beta
    n = len(c)
    along = model[:, :, None] * np.eye(n)
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
) -> currents.CurrentGains:
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
        currents.UNSEEN
        if not seen[j]
        else currents.DETERMINED
        if alone[j] <= currents.LARGEST_SIGMA
        else currents.UP_TO_FACTOR
        if ratio[j] <= currents.LARGEST_SIGMA
        else currents.OF_URDF
        for j in range(len(c))
    )
    gain = 1 / np.where(seen, c, 1.0)
    gain = np.where(seen, gain, sign * np.median(np.abs(gain[seen])))
    inverse = np.linalg.pinv(with_prior[np.ix_(seen, seen)])
    return currents.CurrentGains(
        channels=channels,
        gain=gain,
        sigma=np.where(seen, share * np.abs(gain), np.nan),
        ratio_sigma=np.where(seen, ratio, np.nan),
        reference=reference,
        verdicts=verdicts,
        scale=scale,
        common_sigma=float(1 / np.sqrt(inverse.sum())),
    )


def with_current_gains(
    recording: Recording,
    lib: Library,
    *,
    preparation: Preparation | None = None,
    split: Split | None = None,
) -> Recording:
    """The recording with torques in place of currents with unknown gains."""
    if not recording.has_unknown_gains:
        return recording
    unit = of_gain_one(recording)
    seen = before_test(unit, split or (unit.recipe.split if unit.recipe else None))
    return scaled(recording, current_gains(seen, lib, preparation=preparation))


def of_gain_one(recording: Recording) -> Recording:
    """The recording with its currents counted as torques of gain 1."""
    recipe = recording.recipe
    if recipe is None or recipe.torque is None or not recording.has_unknown_gains:
        return recording
    return recording.replace(recipe=recipe.replace(torque=replace(recipe.torque, gain=1.0)))


def in_torque(recording: Recording, lib: Library, settings: Settings) -> tuple[Recording, Settings]:
    """Torques in place of motor currents with unknown gains, in all recordings."""
    recording = with_current_gains(
        recording, lib, preparation=settings.preparation, split=settings.split
    )
    gains = recording.gains
    if gains is None:
        return recording, settings
    validation, test = (
        None if each is None else scaled(each, gains)
        for each in (settings.validation, settings.test)
    )
    return recording, replace(settings, validation=validation, test=test)
