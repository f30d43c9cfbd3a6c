"""Draws from the posterior of an identified model, every one physically consistent.

    U(π) = ‖A π − b‖² / 2S + κ Σ_k [tr(P0_k⁻¹ P_k) − log det P_k],   p(π) ∝ exp(−U)  where P_k ≻ 0

One Hamiltonian Monte Carlo chain per draw, all chains at once, in coordinates z with
π = π* + L z, where π* is the most probable model and L the root of Laplace's covariance: there the
density is close to a standard normal one. Chains start from normal draws and only correct what
Laplace's approximation leaves; draws of different chains are independent. P0 is that of the URDF
where the log favours it by `ODDS` to the one that identification uses, whose thin axes are raised,
else the latter. The error of the estimate and nuisance torque are added with normal factors, so
that the draws spread as the intervals of the result do. Friction follows from π and from these
factors by its conditional normal distribution. Source: Neal 2011, Sec. 5.
"""

from dataclasses import dataclass

import numpy as np

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.convex import entropic_prior as entropic
from runtime.estimators.convex.newton import convex_problem, solve
from runtime.estimators.regression.factor import Reduced
from runtime.identification.posterior_file import SavedPosterior
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library, Mask
from runtime.recording.settings import names_where

TRAJECTORIES = 12  # Hamiltonian trajectories of each chain
LEAPS = 6  # leapfrog steps of one trajectory; with STEP its length is a quarter of a period
STEP = 0.25  # leapfrog step in units of the standard deviation
START = 0.7  # size of the first draws in units of Laplace's: fewer of them lie outside the cone
ODDS = 20.0
"""Bayes factor from which on thin links are drawn about the bodies of the URDF: rods and plates are
often simplifications, and a prior about them leaves their centres of mass hardly any width."""
REDRAWS = 50  # draws of friction, or of a factor, that are tried before it is set to zero


@dataclass(frozen=True, slots=True, eq=False)
class Draws:
    """Models that the data and the prior allow."""

    pi: Array  # (N, 10 n_links), every link strictly consistent
    phi: Array  # (N, n, k) friction coefficients
    mode: Array  # most probable π, (10 n_links,)
    acceptance: float  # share of accepted trajectories
    # how many times thicker than in the URDF the prior takes each link, (n_links,); 1 as stated
    thickened: Array
    # effective number of independent draws, from what a chain keeps of its state over the second
    # half of its trajectories; at most N
    effective: float


@dataclass(frozen=True, slots=True, eq=False)
class _Density:
    """U and its gradient in z, for many chains at once."""

    bodies: entropic.Bodies
    prior: entropic.Prior
    rows: Array
    target: Array
    kappa: float
    mode: Array
    root: Array

    def pi(self, z: Array) -> Array:
        """π of every chain, (N, 10 n)."""
        return np.asarray(self.mode + z @ self.root.T)

    def energy(self, z: Array) -> Array:
        """U of every chain, (N,); infinite where a link is not consistent."""
        pi = self.pi(z)
        values, inside = self.consistency(pi)
        log_det = np.log(np.maximum(values, 1e-300)).sum(axis=1).reshape(len(z), -1).sum(axis=1)
        misfit = pi @ self.rows.T - self.target
        cost = np.einsum("ij,ij->i", misfit, misfit) / 2
        return np.where(inside, cost + self.kappa * (pi @ self.prior.slope - log_det), np.inf)

    def consistency(self, pi: Array) -> tuple[Array, Mask]:
        """Eigenvalues of all P_k, (N n, 4), and whether each model (N, 10 n) is consistent."""
        values = np.asarray(np.linalg.eigvalsh(self.bodies.pseudo_inertia(pi.ravel())), float)
        return values, np.asarray((values[:, 0] > 0).reshape(len(pi), -1).all(axis=1))

    def slope(self, z: Array) -> Array:
        """∂U/∂z, (N, 10 n); outside the cone that of −log |det P|."""
        pi = self.pi(z)
        inverse: Array = np.asarray(np.linalg.inv(self.bodies.pseudo_inertia(pi.ravel())), float)
        barrier = self.bodies.against(inverse).reshape(pi.shape)
        gradient = (pi @ self.rows.T - self.target) @ self.rows
        gradient += self.kappa * (self.prior.slope - barrier)
        return np.asarray(gradient @ self.root)


@one_blas_thread
def draw_models(
    lib: Library, saved: SavedResult, posterior: SavedPosterior, size: int, rng: np.random.Generator
) -> Draws:
    """Draw models from a posterior."""
    if size < 1:
        raise IdentificationError(f"expected one model or more, got {size}; correct --size")
    data, system = posterior.reduced(lib)
    try:
        density = _density(lib, posterior, data)
    except np.linalg.LinAlgError:
        raise IdentificationError(
            "the posterior is narrower than rounding, so that no model can be drawn from it; "
            "identify a log with the noise of a measurement"
        ) from None
    z, acceptance, kept = _chains(density, size, rng)
    pi, factors = _with_error(density, density.pi(z), posterior.pi_root[:, lib.pi0.size :], rng)
    # φ | π is normal around what the result states at its π, moved by the same nuisance torque.
    mean = saved.phi.ravel() + (pi - posterior.pi) @ posterior.usual(system.slope).T
    if posterior.phi_nuisance is not None and posterior.phi_nuisance.size:
        moved = posterior.usual(posterior.phi_nuisance)
        mean += factors[:, : moved.shape[1]] @ moved.T
    phi = _friction(mean, posterior.usual(posterior.phi_root(system)), saved.friction.columns, rng)
    effective = size * (1 - kept) / (1 + kept)
    thickened = (
        density.prior.thinnest() / entropic.prior_of(lib, floor=entropic.AS_STATED).thinnest()
    )
    phi = phi.reshape(size, *saved.phi.shape)
    return Draws(pi, phi, density.mode, acceptance, thickened, effective)


def _density(lib: Library, posterior: SavedPosterior, data: Reduced) -> _Density:
    known = posterior.information
    scale = np.sqrt(known.density)
    rows, target = data.factor / scale, data.target / scale

    def about(prior: entropic.Prior) -> _Density:
        # The mode of U: γ = κ S / N in the units of the convex problem.
        gamma = known.kappa * known.density / data.count
        mode = solve(lib, convex_problem(data, prior, gamma)).pi
        root = entropic.spread_of(prior.bodies, mode, rows, known.kappa).root
        return _Density(prior.bodies, prior, rows, target, known.kappa, mode, root)

    def evidence(density: _Density) -> float:
        return entropic.log_evidence(density.prior, rows, target, known.kappa, density.mode)

    thick = about(entropic.prior_of(lib, known.centre, floor=0.0))
    if not np.allclose(known.centre, entropic.prior_of(lib).centre, rtol=1e-9, atol=1e-12):
        return thick  # another first guess, or the centre of a type
    stated = about(entropic.prior_of(lib, floor=entropic.AS_STATED))
    return stated if evidence(stated) > evidence(thick) + np.log(ODDS) else thick


def _chains(density: _Density, count: int, rng: np.random.Generator) -> tuple[Array, float, float]:
    """Last state of every chain, share of accepted trajectories, correlation over half of them."""
    z = START * rng.standard_normal((count, density.mode.size))
    energy = density.energy(z)
    while not np.isfinite(energy).all():  # half as far until all bodies exist
        outside = ~np.isfinite(energy)
        z[outside] /= 2
        energy[outside] = density.energy(z[outside])
    accepted, middle = 0, z
    for k in range(TRAJECTORIES):
        if k == TRAJECTORIES // 2:
            middle = z.copy()
        momentum = rng.standard_normal(z.shape)
        # Lengths that vary keep a chain from returning to where it was.
        step = STEP * rng.uniform(0.8, 1.2)
        before = energy + np.einsum("ij,ij->i", momentum, momentum) / 2
        new, p = z.copy(), momentum - step / 2 * density.slope(z)
        for leap in range(LEAPS):
            new += step * p
            p -= (step if leap < LEAPS - 1 else step / 2) * density.slope(new)
        reached = density.energy(new)
        after = reached + np.einsum("ij,ij->i", p, p) / 2
        is_taken = np.log(rng.uniform(size=count)) < before - after
        z, energy = np.where(is_taken[:, None], new, z), np.where(is_taken, reached, energy)
        accepted += int(is_taken.sum())
    kept = 0.0
    if count > 2:
        a, b = middle - middle.mean(axis=0), z - z.mean(axis=0)
        kept = float(np.sum(a * b) / np.sqrt(np.sum(a * a) * np.sum(b * b)))
    return z, accepted / (TRAJECTORIES * count), min(max(kept, 0.0), 1.0)


def _with_error(
    density: _Density, pi: Array, errors: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """π + Σ ε d and normal factors ε, (N, m), of the errors d, (10 n, m), all links consistent."""
    factors = np.zeros((len(pi), errors.shape[1]))
    for k, error in enumerate(errors.T):
        pending = np.arange(len(pi))
        for _ in range(REDRAWS):
            factor = rng.standard_normal(len(pending))
            moved = pi[pending] + factor[:, None] * error
            _, inside = density.consistency(moved)
            pi[pending[inside]], factors[pending[inside], k] = moved[inside], factor[inside]
            pending = pending[~inside]
            if not pending.size:
                break
    return pi, factors


def _friction(mean: Array, root: Array, names: tuple[str, ...], rng: np.random.Generator) -> Array:
    """φ of every model, (N, n k), without coefficients below 0 where that would drive a joint."""
    phi = mean + rng.standard_normal((len(mean), root.shape[1])) @ root.T
    known = names_where(lambda column: column.is_nonnegative)
    columns = np.array([name in known for name in names], dtype=bool)
    bounded = np.tile(columns, phi.shape[1] // max(len(names), 1))
    for _ in range(REDRAWS):
        wrong = (phi[:, bounded] < 0).any(axis=1)
        if not wrong.any():
            break
        phi[wrong] = mean[wrong] + rng.standard_normal((int(wrong.sum()), root.shape[1])) @ root.T
    return np.where(bounded & (phi < 0), 0.0, phi)
