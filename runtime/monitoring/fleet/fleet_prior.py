"""Prior of a type, fleet.toml: inertias, friction and noise, for `identify --prior`.

Friction is the mean of every coefficient over the units, and their spread,

    φ_u ~ N(μ, τ² + v_u)   per joint and column, v_u the variance of the estimate of unit u

μ and the standard deviation of a further unit are means over τ, uniform on a grid, weighted by its
restricted likelihood. Noise is that of long logs of the other units, which the residuals of a few
seconds of a new unit cannot show.
Source: Patterson & Thompson 1971 for the restricted likelihood; Gelman 2006 for the uniform τ.

The inertias are a hierarchy: centre of the type, spread of its units, and each unit.

    A_u K π_u = b_u + N(0, 1),   p(π_u) ∝ exp(−κ D(P_u, P0)),   p(P0) ∝ exp(−κ_0 D(P0, P_URDF))
    D(P, P0) = Σ_k [tr(P0_k⁻¹ P_k) − log det P_k + log det P0_k − 4]

About P0 the prior of a unit is normal, π_u = π0 + R z with R Rᵀ = B⁻¹ the curvature of D and
z ~ N(0, 1/κ). With H = K R this gives the marginal likelihood of κ and of P0 in closed form,

    b_u − A_u K π0 ~ N(0, V_u),   V_u = 1 + A_u H Hᵀ A_uᵀ / κ,

and T_u = rᵀ V_u⁻¹ r is χ² with n_b degrees of freedom for a unit of the type. The alternation of
each unit's maximum a posteriori with the centre of all units then removes what the normal law
neglects:

    P_u = argmin ½ ‖A_u K π − b_u‖² + κ D(P, P0)          one convex problem per unit
    P0 = argmin κ Σ_u D(P_u, X) + κ_0 D(X, P_URDF)        see `centre_of`

This is the EM algorithm for P0 as far as a posterior mean is its mode. From the URDF it would be
slow in directions that a log hardly determines; it begins at the centre of the normal law.
Source: Lee, Wensing & Park 2019 (D); Dempster, Laird & Rubin 1977 (EM); Box 1980 for T; MacKay
2003, Ch. 28, for the marginal likelihood.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import minimize_scalar
from scipy.special import chdtrc, chdtri

from runtime.common.files import toml_lines, write_text
from runtime.common.threads import cores
from runtime.errors import IdentificationError, RuntimeFault
from runtime.estimators.convex.entropic_prior import CAD, Prior, prior_from, prior_of
from runtime.estimators.convex.newton import convex_problem, solve, solve_many
from runtime.estimators.prior_file import KnownFriction, read_prior
from runtime.estimators.problem import NoiseFloor
from runtime.estimators.regression.factor import Reduced
from runtime.estimators.regression.posterior import posterior_of
from runtime.library import Array, Library, Mask
from runtime.library.parameters import N_PARAMETERS, PI_NAMES, links
from runtime.monitoring.fleet.gather import Unit, common_columns
from runtime.recording.settings import WIDTHS, widths_of

LEAST_UNITS = 3
"""Smallest number of units: with two, a spread and an outlier cannot be distinguished."""
ALPHA = 0.01  # probability that a fleet without outliers has a unit that stands out
LOWEST, HIGHEST = 0.5, 1e6  # range of κ: units that differ by more than their size, and by 0.1 %
WIDER = 40.0  # spread of a link that departs from the type, over that of its units
ROUNDS = 8  # largest number of choices of the units that count
PASSES = 4
STILL = 1e-3  # step of the centre, as a standard deviation of a unit, below which the passes end


@dataclass(frozen=True, slots=True)
class FleetFit:
    """Hierarchical prior of a type, and its units."""

    centre: Array  # π0 of the type, (10 n,), P0_k ≻ 0
    kappa: float  # κ, so that 1/√κ is the relative standard deviation of a unit from the centre
    interval: tuple[float, float]  # 95 % interval of κ by the likelihood ratio
    # κ of the prior of a new unit: the spread of the units and the error of the centre
    trust: float
    pi: Array  # most probable parameters of each unit, (U, 10 n)
    statistic: Array  # T of each unit, (U,)
    p_value: Array  # probability of a larger T, times the number of units, at most 1; (U,)
    stands_out: Mask  # whether a unit differs from its type by more than the spread, (U,)
    # link of each unit that stands out by which it differs; −1 for the others, (U,)
    links: NDArray[np.int_]
    covariance: Array  # of β of each unit, (U, n_b, n_b)


def fit_fleet(lib: Library, units: Sequence[Unit]) -> FleetFit:
    """Centre, spread and units of a fleet."""
    if len(units) < LEAST_UNITS:
        raise IdentificationError(
            f"expected statistics of at least {LEAST_UNITS} units, got {len(units)}; identify more "
            "units with --settings save_statistics=true"
        )
    urdf = prior_of(lib)
    A, b = np.stack([u.factor for u in units]), np.stack([u.target for u in units])
    centre, kappa, interval = urdf.centre, CAD, (LOWEST, HIGHEST)
    counted = np.ones(len(units), dtype=bool)
    for k in range(ROUNDS):
        view = _View(lib, urdf, A, b, centre)
        # The first κ is that of the median unit, which outliers hardly move.
        kappa, interval = (view.median(), interval) if k == 0 else view.likeliest(counted)
        centre = view.centre(counted, kappa)
        before = counted
        view = _View(lib, urdf, A, b, centre)
        counted = view.p_value(kappa) >= ALPHA
        if counted.sum() < LEAST_UNITS:
            counted = np.argsort(view.statistic(kappa)).argsort() < LEAST_UNITS
        if k > 1 and (counted == before).all():
            break
    pi, centre = alternate(lib, urdf, (A, b), counted, kappa, centre)
    view = _View(lib, urdf, A, b, centre)
    p_value, T = view.p_value(kappa), view.statistic(kappa)
    out, links = p_value < ALPHA, np.full(len(units), -1)
    # The parameters of a unit that stands out follow its data where it departs from the type.
    for u in np.flatnonzero(out):
        links[u] = view.link(int(u), kappa)
        weights = np.full(lib.n_links, kappa)
        weights[links[u]] /= WIDER**2
        data = Reduced(np.ascontiguousarray(A[u] @ lib.base_matrix), b[u], 0.0, 1.0, 1.0)
        pi[u] = solve(lib, convex_problem(data, prior_from(urdf.bodies, centre), weights)).pi
    trust = view.trust(counted, kappa)
    return FleetFit(
        centre, kappa, interval, trust, pi, T, p_value, out, links, view.covariance(kappa)
    )


class _View:
    """Units about a centre π0: residuals r_u = b_u − A_u K π0 in the eigenvectors of V_u."""

    def __init__(self, lib: Library, urdf: Prior, A: Array, b: Array, centre: Array) -> None:
        self.lib, self.urdf, self.A, self.b = lib, urdf, A, b
        self.H = lib.base_matrix @ block_diag(*urdf.bodies.spread(centre))
        AH = A @ self.H
        self.values, self.vectors = np.linalg.eigh(AH @ np.swapaxes(AH, 1, 2))
        self.values = np.maximum(self.values, 0.0)
        self.rest = np.einsum("uji,uj->ui", self.vectors, b - A @ (lib.base_matrix @ centre))

    def statistic(self, kappa: float) -> Array:
        """T of every unit, (U,)."""
        return np.sum(self.rest**2 / (1 + self.values / kappa), axis=1)

    def p_value(self, kappa: float) -> Array:
        """Corrected p-value of every unit, (U,)."""
        T = self.statistic(kappa)
        return np.asarray(np.minimum(chdtrc(self.rest.shape[1], T) * len(T), 1.0))

    def median(self) -> float:
        """κ at which the median of T is that of χ²."""
        goal = chdtri(self.rest.shape[1], 0.5)
        low, high = np.log(LOWEST), np.log(HIGHEST)
        for _ in range(60):
            middle = (low + high) / 2
            if np.median(self.statistic(float(np.exp(middle)))) < goal:
                low = middle
            else:
                high = middle
        return float(np.exp(low))

    def likeliest(self, counted: Mask) -> tuple[float, tuple[float, float]]:
        """κ of the largest marginal likelihood over the counted units, and its 95 % interval."""
        values, square = self.values[counted], self.rest[counted] ** 2

        def cost(log_kappa: float) -> float:
            width = 1 + values * np.exp(-log_kappa)
            return float(np.sum(square / width + np.log(width))) / 2

        bounds = (np.log(LOWEST), np.log(HIGHEST))
        best = float(minimize_scalar(cost, bounds=bounds, method="bounded").x)
        limit = cost(best) + chdtri(1, 0.05) / 2
        ends = []
        for end in bounds:
            inside, outside = best, end
            for _ in range(40):
                middle = (inside + outside) / 2
                inside, outside = (middle, outside) if cost(middle) < limit else (inside, middle)
            ends.append(float(np.exp(inside)))
        return float(np.exp(best)), (ends[0], ends[1])

    def _rows(self, counted: Mask, kappa: float) -> Array:
        """Triangle of V_u^-½ [A_u b_u] of the counted units, (n_b + 1, n_b + 1)."""
        width = np.sqrt(1 + self.values[counted] / kappa)[:, :, None]
        whole = np.concatenate([self.A[counted], self.b[counted][:, :, None]], axis=2)
        rows = np.swapaxes(self.vectors[counted], 1, 2) @ whole / width
        return np.asarray(np.linalg.qr(rows.reshape(-1, rows.shape[2]), mode="r"))

    def centre(self, counted: Mask, kappa: float) -> Array:
        """Most probable centre of the type, (10 n,): the normal law of all units with the URDF."""
        rows = self._rows(counted, kappa)
        factor = np.ascontiguousarray(rows[:, :-1] @ self.lib.base_matrix)
        data = Reduced(factor, np.ascontiguousarray(rows[:, -1]), 0.0, 1.0, 1.0)
        return solve(self.lib, convex_problem(data, self.urdf, CAD)).pi

    def trust(self, counted: Mask, kappa: float) -> float:
        """κ of a new unit: the mean of 1/(1/κ + e) over directions of β, e the error of P0 there.

        Directions that no unit excites keep the error of the URDF; the mean of the precisions
        weakens the prior there and keeps the information of the fleet in the other directions.
        """
        around = self.urdf.bodies.spread(self.urdf.centre)
        H = self.lib.base_matrix @ block_diag(*around) / np.sqrt(CAD)
        root = posterior_of(self._rows(counted, kappa)[:, :-1], prior=H).root
        # Share of every base direction of the prior's unit covariance H Hᵀ.
        scaled = np.linalg.svd(np.linalg.lstsq(self.H, root, rcond=None)[0], compute_uv=False)
        return float(np.mean(1 / (1 / kappa + np.sort(scaled**2)[::-1][: len(self.H)])))

    def covariance(self, kappa: float) -> Array:
        """Covariance of β of every unit, (U, n_b, n_b)."""
        prior = self.H @ self.H.T / kappa
        seen = np.swapaxes(self.vectors, 1, 2) @ self.A @ prior
        seen /= np.sqrt(1 + self.values / kappa)[:, :, None]
        return np.asarray(prior - np.swapaxes(seen, 1, 2) @ seen)

    def link(self, unit: int, kappa: float) -> int:
        """Link whose departure from the type explains a unit best.

        The likelihood of the unit where the spread of one link is `WIDER` times larger; a larger
        spread of a link that explains nothing costs the determinant.
        """
        A, at = self.A[unit], self.vectors[unit]
        rest = at @ self.rest[unit]
        V = np.eye(len(A)) + A @ self.H @ self.H.T @ A.T / kappa
        costs = []
        for k in range(self.lib.n_links):
            H = A @ self.H[:, k * N_PARAMETERS : (k + 1) * N_PARAMETERS] * WIDER
            try:
                lower = np.linalg.cholesky(V + H @ H.T / kappa)
            except np.linalg.LinAlgError:
                raise IdentificationError(
                    f"the log of unit {unit + 1} has numbers of too many orders of magnitude to "
                    "compare its links; inspect it, or leave the unit out"
                ) from None
            costs.append(
                float(np.sum(np.linalg.solve(lower, rest) ** 2))
                + 2 * float(np.log(np.diagonal(lower)).sum())
            )
        return int(np.argmin(costs))


def alternate(
    lib: Library, urdf: Prior, data: tuple[Array, Array], counted: Mask, kappa: float, centre: Array
) -> tuple[Array, Array]:
    """Alternate each unit's maximum a posteriori with the centre of the counted units."""
    bodies = urdf.bodies
    of_urdf = bodies.pseudo_inertia(urdf.centre)
    factors = [np.ascontiguousarray(A @ lib.base_matrix) for A in data[0]]
    starts: list[Array | None] = [None] * len(factors)
    for _ in range(PASSES):
        prior = prior_from(bodies, centre)
        problems = [
            convex_problem(Reduced(A, b, 0.0, 1.0, 1.0), prior, kappa)
            for A, b in zip(factors, data[1], strict=True)
        ]
        pi = np.stack([minimum.pi for minimum in solve_many(lib, problems, starts, cores())])
        starts = list(pi)
        pseudo = bodies.pseudo_inertia(pi[counted]).reshape(int(counted.sum()), -1, 4, 4)
        moved = bodies.pi_of(centre_of(pseudo, of_urdf, kappa, CAD)).ravel()
        # Lengths of the changes of the links in units of the prior with κ = 1.
        change = (moved - centre).reshape(-1, N_PARAMETERS, 1)
        step = np.linalg.norm(np.linalg.solve(bodies.spread(centre), change), axis=1)
        centre = moved
        if step.max() * np.sqrt(kappa) < STILL:
            break
    return pi, centre


def centre_of(pseudo: Array, urdf: Array, kappa: float, kappa_0: float) -> Array:
    """Centre X of bodies (U, n, 4, 4), the minimiser of κ Σ_u D(P_u, X) + κ_0 D(X, P_URDF).

    Its slope is 0 where κ_0 X P⁻¹ X + (κ U − κ_0) X = κ Σ P_u, P of the URDF. With P = L Lᵀ,
    X = L W Lᵀ this is κ_0 W² + (κ U − κ_0) W = L⁻¹ (κ Σ P_u) L⁻ᵀ, a quadratic equation of each
    eigenvalue.
    """
    lower = np.linalg.cholesky(urdf)
    inverse = np.linalg.inv(lower)
    whole = inverse @ (kappa * pseudo.sum(axis=0)) @ np.swapaxes(inverse, 1, 2)
    values, vectors = np.linalg.eigh((whole + np.swapaxes(whole, 1, 2)) / 2)
    linear = kappa * len(pseudo) - kappa_0
    # The root above 0, without the difference of two large numbers.
    root = np.sqrt(linear**2 + 4 * kappa_0 * values)
    solved = np.where(linear > 0, 2 * values / (linear + root), (root - linear) / (2 * kappa_0))
    inner = (vectors * solved[:, None]) @ np.swapaxes(vectors, 1, 2)
    return np.asarray(lower @ inner @ np.swapaxes(lower, 1, 2))


GRID = 80  # values of τ, from 1/1000 of the smallest to the largest possible one


@dataclass(frozen=True, slots=True, eq=False)
class FleetFriction(KnownFriction):
    """Friction coefficients of a type, and those of its units."""

    units: Array  # of every unit, (U, n, k); NaN where its log does not determine one


def fit_friction(lib: Library, units: Sequence[Unit], fit: FleetFit) -> FleetFriction:
    """Friction of a type from its units."""
    columns = common_columns(units)
    shape = (lib.n_joints, len(columns))
    beta = fit.pi @ lib.base_matrix.T
    phi, variance = np.zeros((len(units), *shape)), np.zeros((len(units), *shape))
    for u, unit in enumerate(units):
        rows = unit.friction[:, [unit.columns.index(name) for name in columns]]
        slope = rows[..., 1:-1]
        phi[u] = rows[..., 0] - slope @ beta[u]
        of_beta = np.einsum("jki,il,jkl->jk", slope, fit.covariance[u], slope, optimize=True)
        # Large slopes cancel, so that the rounding of C_β may be below 0.
        variance[u] = rows[..., -1] + np.maximum(of_beta, 0.0)
    known = np.isfinite(variance)
    phi = np.where(known, phi, np.nan)
    mean, sigma = np.full(shape, np.nan), np.full(shape, np.inf)
    for at in np.ndindex(*shape):
        counted = known[:, *at] & ~fit.stands_out
        if counted.sum() >= LEAST_UNITS:
            mean[at], sigma[at] = random_effects(phi[:, *at][counted], variance[:, *at][counted])
    widths = dict(zip(WIDTHS, units[0].widths, strict=True))
    return FleetFriction(columns, widths, mean, sigma, phi)


def random_effects(values: Array, variance: Array) -> tuple[float, float]:
    """Mean of values with a spread of their own, and the standard deviation of a further one."""
    largest = np.ptp(values) + np.sqrt(variance.max())
    smallest = 1e-3 * np.sqrt(variance.min())
    tau = np.concatenate([[0.0], np.geomspace(min(smallest, largest), largest, GRID)])
    weight = 1 / (variance + tau[:, None] ** 2)
    total = weight.sum(axis=1)
    mean = weight @ values / total
    misfit = np.sum(weight * (values - mean[:, None]) ** 2, axis=1)
    cost = misfit - np.log(weight).sum(axis=1) + np.log(total)
    # The mean over τ instead of the best τ: its likelihood is often largest at 0, which would
    # claim that all units are alike.
    share = np.exp((cost.min() - cost) / 2) * np.gradient(tau)
    share /= share.sum()
    centre = float(share @ mean)
    return centre, float(np.sqrt(share @ (tau**2 + 1 / total + (mean - centre) ** 2)))


def prior_text(
    lib: Library,
    names: Sequence[str],
    fit: FleetFit,
    friction: FleetFriction,
    noise: NoiseFloor | None = None,
) -> str:
    """TOML text of a fleet's prior."""
    out = [name for name, flag in zip(names, fit.stands_out, strict=True) if flag]
    known = np.isfinite(friction.sigma) & (friction.sigma > 0)
    tables: dict[str, Any] = {
        "trust": fit.trust,
        "fleet": {
            "robot": lib.name,
            "model_hash": lib.manifest.model_hash,
            "units": len(names) - len(out),
            "kappa": fit.kappa,
            "kappa_interval": list(fit.interval),
            "spread_percent": float(f"{100 / np.sqrt(fit.kappa):.6g}"),
            "stand_out": out,
        },
        "centre": dict(zip(lib.link_names, links(fit.centre).tolist(), strict=True)),
    }
    if known.any():
        needed = widths_of(friction.columns)
        tables["friction"] = {key: x for key, x in friction.widths.items() if key in needed}
    for j in np.flatnonzero(known.any(axis=1)):
        pairs = zip(friction.columns, friction.mean[j], friction.sigma[j], known[j], strict=True)
        tables["friction"][lib.joint_names[j]] = {
            name: [float(mean), float(sigma)] for name, mean, sigma, is_known in pairs if is_known
        }
    if noise is not None:  # N/N_eff, and the standard deviation of the torque per joint
        of_joints = dict(zip(lib.joint_names, noise.sigma.tolist(), strict=True))
        tables["noise"] = {"inflation": noise.inflation, **of_joints}
    head = (
        f"# Prior of the type '{lib.name}' from {len(names)} units; use it with identify --prior.",
        f"# centre: {', '.join(PI_NAMES)} in kg, kg*m, kg*m^2, inertia about the origin of the "
        "link frame",
    )
    return "\n".join([*head, *toml_lines(tables)]) + "\n"


def write_prior(path: Path, text: str, lib: Library) -> None:
    """Write a prior as a whole or not at all, and read it again."""
    write_text(path, text)
    known = read_prior(path, lib)
    if known.centre is None or not np.isfinite(known.centre).all():
        raise RuntimeFault(f"'{path}' cannot be read again; report this with the statistics")


def fit_noise(units: Sequence[Unit], fit: FleetFit) -> NoiseFloor | None:
    """Usual noise of the units of a type."""
    pairs = zip(units, fit.stands_out, strict=True)
    counted = [unit for unit, is_out in pairs if not is_out and np.isfinite(unit.noise).all()]
    if len(counted) < LEAST_UNITS:
        return None
    sigma = np.median([unit.noise for unit in counted], axis=0)
    return NoiseFloor(sigma, max(float(np.median([unit.density for unit in counted])), 1.0))
