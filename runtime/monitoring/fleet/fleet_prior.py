"""Prior of a type, fleet.toml: inertias of `hierarchy`, friction and noise, for `identify --prior`.

Friction is the mean of every coefficient over the units, and their spread,

    φ_u ~ N(μ, τ² + v_u)   per joint and column, v_u the variance of the estimate of unit u

μ and the standard deviation of a further unit are means over τ, uniform on a grid, weighted by its
restricted likelihood.

Noise is what the residuals of a few seconds of a new unit cannot show: many unknowns explain few
rows too well, while residuals of long logs of other units show how large and how coloured the
errors of the model are.
Source: Patterson & Thompson 1971 for the restricted likelihood; Gelman 2006 for the uniform τ.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.common.files import replacing
from runtime.errors import RuntimeFault
from runtime.estimators.prior_file import read_prior
from runtime.estimators.problem import NoiseFloor
from runtime.library import Array, Library
from runtime.library.parameters import PI_NAMES, links
from runtime.monitoring.fleet.gather import Unit, common_columns
from runtime.monitoring.fleet.hierarchy import LEAST_UNITS, FleetFit
from runtime.recording.settings import WIDTHS, widths_of

GRID = 80
"""Values of τ, from 1/1000 of the smallest to the largest possible one."""


@dataclass(frozen=True, slots=True)
class FleetFriction:
    """Friction coefficients of a type."""

    columns: tuple[str, ...]  # names of the k columns that all units have
    # coulomb_speed, stribeck_speed [rad/s] and dahl_stroke [rad] of the columns
    widths: tuple[float, float, float]
    mean: Array  # μ, (n, k) [N·m per unit of the column]; NaN where nothing is known
    sigma: Array  # standard deviation of a further unit, (n, k)
    units: Array  # coefficients of every unit, (U, n, k); NaN where its log does not determine one


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
    return FleetFriction(columns, units[0].widths, mean, sigma, phi)


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
    low, high = fit.interval
    lines = [
        f"# Prior of the type '{lib.name}' from {len(names)} units; use it with identify --prior.",
        f"trust = {fit.trust!r}",
        "",
        "[fleet]",
        f"robot = {_text(lib.name)}",
        f"model_hash = {_text(lib.manifest.model_hash)}",
        f"units = {len(names) - len(out)}",
        f"kappa = {fit.kappa!r}",
        f"kappa_interval = [{low!r}, {high!r}]",
        f"spread_percent = {100 / np.sqrt(fit.kappa):.6g}",
        f"stand_out = [{', '.join(map(_text, out))}]",
        "",
        "[centre]",
        f"# {', '.join(PI_NAMES)}: kg, kg*m, kg*m^2, inertia about the origin of the link frame",
    ]
    for name, body in zip(lib.link_names, links(fit.centre), strict=True):
        lines.append(f"{_text(name)} = [{', '.join(map(repr, body.tolist()))}]")
    known = np.isfinite(friction.sigma) & (friction.sigma > 0)
    if known.any():
        needed = widths_of(friction.columns)
        lines += ["", "[friction]"]
        pairs = zip(WIDTHS, friction.widths, strict=True)
        lines += [f"{key} = {width!r}" for key, width in pairs if key in needed]
    for j, joint in enumerate(lib.joint_names):
        if known[j].any():
            lines += ["", f"[friction.{_text(joint)}]"]
        for k in np.flatnonzero(known[j]):
            pair = f"[{float(friction.mean[j, k])!r}, {float(friction.sigma[j, k])!r}]"
            lines.append(f"{_text(friction.columns[k])} = {pair}")
    if noise is not None:
        lines += [
            "",
            "[noise]",
            "# inflation N/N_eff; per joint the standard deviation of the torque",
        ]
        lines.append(f"inflation = {noise.inflation!r}")
        pairs_of_noise = zip(lib.joint_names, noise.sigma.tolist(), strict=True)
        lines += [f"{_text(joint)} = {sigma!r}" for joint, sigma in pairs_of_noise]
    return "\n".join(lines) + "\n"


def write_prior(path: Path, text: str, lib: Library) -> None:
    """Write a prior as a whole or not at all, and read it again."""
    with replacing(path) as file:
        file.write(text.encode())
    known = read_prior(path, lib)
    if known.centre is None or not np.isfinite(known.centre).all():
        raise RuntimeFault(f"'{path}' cannot be read again; report this with the statistics")


def _text(value: str) -> str:
    """A TOML string; its escapes are those of JSON without DEL."""
    return json.dumps(value, ensure_ascii=True)


def fit_noise(units: Sequence[Unit], fit: FleetFit) -> NoiseFloor | None:
    """Usual noise of the units of a type.

    Returns (n,) [N·m, N].
    """
    pairs = zip(units, fit.stands_out, strict=True)
    counted = [unit for unit, is_out in pairs if not is_out and np.isfinite(unit.noise).all()]
    if len(counted) < LEAST_UNITS:
        return None
    sigma = np.median([unit.noise for unit in counted], axis=0)
    return NoiseFloor(sigma, max(float(np.median([unit.density for unit in counted])), 1.0))
