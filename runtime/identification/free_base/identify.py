"""Identification of a robot with a free base: most probable consistent bodies, and their intervals.

The rows of `rows` are given to the method map (entropic prior at the URDF, the base link included),
so that what the log does not determine keeps the values of the URDF, and says so.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import replacing
from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.convex import CAD, bodies_of, com_sigma, prior_of, reduce, spread_of
from runtime.estimators.methods import fit_by
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.samples import NORMAL_95, thesis_weights
from runtime.estimators.uncertainty import IDENTIFIED, PRIOR_DOMINATED, vague_posterior
from runtime.identification.free_base.contact_conventions import (
    require_contact_conventions,
    require_torque_sign,
)
from runtime.identification.free_base.noise import VerticalForce, noise_of, rms, vertical_force
from runtime.identification.free_base.plausibility import (
    notes_on_errors,
    require_clock,
    require_forces_on_robot,
    require_joint_units,
    require_prior_of_bodies,
)
from runtime.identification.free_base.rows import FreeBaseRows, error_names, rows_of, sensor_prior
from runtime.library import Array, Library
from runtime.library.parameters import (
    MASS,
    N_PARAMETERS,
    PI_NAMES,
    centre_of_mass,
    inertia,
    links,
    mass,
)
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.preprocessing.free_base_motion import motion_of

SHARE = 0.6
"""Share of the log that is trained on."""
DETERMINED = 0.5
"""Posterior over prior variance below which an entry counts as identified."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeBaseIdentification:
    """Result of an identification with a free base.

    Attributes:
        lib: library of the robot.
        pi: π, (10 L,), the base link first.
        root: root of the covariance of π.
        share: posterior over prior variance of every entry of π, (10 L,).
        rows: choice of rows.
        row_names: names of the rows whose errors are stated.
        rms: RMS of their right side, (k,), on the test part.
        before, after: RMS errors of URDF and result on the test part, (k,).
        n_train, n_test: number of instants.
        n_eff: effective sample size.
        seconds: duration of the test part.
        status: how the fit ended.
        notes: sentences on the data.
        offset_mass: standard deviation of the total mass by offsets of the force sensors [kg],
            before the prior of the URDF.
        sensors: errors of the sensors of vertical forces: offsets by link [N], γ as `sharing`, and
            crosstalk [1/m].
        vertical: of ΣF_z, where all vertical forces were measured; None otherwise.
    """

    lib: Library
    pi: Array
    root: Array
    share: Array
    rows: str
    row_names: tuple[str, ...]
    rms: Array
    before: Array
    after: Array
    n_train: int
    n_test: int
    n_eff: float
    seconds: float
    status: str
    notes: tuple[str, ...]
    offset_mass: float
    sensors: dict[str, float]
    vertical: VerticalForce | None

    @property
    def mass(self) -> tuple[float, float]:
        """Total mass and its standard deviation [kg], that of the sensors' offsets included."""
        pick = np.zeros(self.pi.size)
        pick[MASS::N_PARAMETERS] = 1.0
        return float(pick @ self.pi), float(np.linalg.norm(pick @ self.root))

    @property
    def verdicts(self) -> tuple[str, ...]:
        """Per entry of π: identified, or prior-dominated."""
        return tuple(IDENTIFIED if s < DETERMINED else PRIOR_DOMINATED for s in self.share)

    @property
    def is_consistent(self) -> bool:
        """Whether every link is strictly consistent."""
        return bool(self.lib.relative_eigenvalues(self.pi).min() > 0)


@one_blas_thread
def identify_free_base(
    recording: FreeBaseRecording,
    lib: Library,
    rows: str = "all",
    *,
    cutoff_hz: float | None = None,
    share: float = SHARE,
    prior: PriorFile | None = None,
    trim_s: float = 0.0,
) -> FreeBaseIdentification:
    """Identify π of a robot with a free base."""
    if not lib.manifest.floating:
        raise IdentificationError(
            f"the base of '{lib.name}' is fixed, so a log with the motion of a base does not fit; "
            "build the robot with --floating, or give a log of joints alone"
        )
    if not 0.1 <= share <= 0.95:
        raise IdentificationError(
            f"expected a training share of 0.1 to 0.95 of the log, got {share:g}; use --split"
        )
    require_prior_of_bodies(prior)
    require_clock(recording)
    motion = motion_of(recording, lib.joint_names, cutoff_hz)
    require_joint_units(lib, motion, recording.name)
    inside = np.flatnonzero(
        (motion.t >= motion.t[0] + trim_s) & (motion.t <= motion.t[-1] - trim_s)
    )
    border = motion.t[0] + share * (motion.t[-1] - motion.t[0])
    first, second = inside[motion.t[inside] < border], inside[motion.t[inside] >= border]
    if min(len(first), len(second)) < 1:
        raise IdentificationError("no row is left for training or test; record for longer")
    train, test = motion.rows(first), motion.rows(second)
    trained, tested = rows_of(lib, train, rows), rows_of(lib, test, rows)
    require_forces_on_robot(lib, trained, recording.name)
    require_contact_conventions(lib, train, recording.name)
    require_torque_sign(lib, train, recording.name)
    unknowns = len(lib.base_columns)
    sensed = sensor_prior(motion.contacts, trained.samples.columns.shape[1:])
    noise = noise_of(lib, trained, sensed, cutoff_hz, float(train.t[-1] - train.t[0]))
    fitted = trained.samples if noise is None else noise.weighted(trained.samples)
    floor = None if noise is None else noise.floor
    problem = Problem(
        lib=lib,
        train=fitted,
        validation=tested.samples,
        weights=thesis_weights(fitted.tau) if floor is None else floor.sigma**-2,
        start=lib.lam0,
        noise_floor=floor,
        friction_prior=sensed,
    )
    fit = fit_by(problem, "map", None, prior)
    root, shares = _posterior(problem, fit, prior)
    notes = []
    if floor is not None:
        independent = trained.samples.tau.size / floor.inflation
        notes.append(
            f"{independent:.0f} independent equations for {unknowns} base parameters: most of the "
            "result is the prior, and the residual of the URDF counts as noise, without its mean "
            "and errors of sensors"
        )
    sigma, offset_mass = motion.contacts.offset_sigma, 0.0
    if sigma is not None:
        # An offset b of ΣF_z changes the total mass by b / g.
        offset_mass = float(np.linalg.norm(sigma) / np.linalg.norm(lib.gravity))
    elif motion.tau is None and np.isnan(motion.contacts.wrench).any():
        notes.append(
            "contact forces are taken as free of offsets: an offset of a force sensor changes the "
            "total mass by as much, and its interval does not contain it; state their standard "
            "deviation in N by contact_force_z_sigma"
        )
    fewest, left = np.sort(trained.left)[[0, -1]]
    if fewest < len(trained.names):
        counts = f"{left}" if fewest == left else f"{fewest} to {left}"
        notes.append(
            f"contact wrenches are not measured completely: {counts} of {len(trained.names)} "
            "equations per instant are left"
        )
    if recording.unread:
        notes.append(
            f"arrays that are not read: {', '.join(recording.unread)}; expected names are listed "
            "in docs/howto/free-base.md"
        )
    names, measured = _shown(tested)
    level = rms(measured)
    # The test part may have another number of equations than φ has rows; its first row counts.
    by_sensors = tested.samples.columns @ fit.phi[0]
    after = rms(tested.samples.rigid(lib, fit.pi) + by_sensors - measured)
    sensors = dict(zip(error_names(motion.contacts), fit.phi[0].tolist(), strict=True))
    spread = None if sensed is None else sensed.sigma[0]
    notes += notes_on_errors(level, after, sensors, spread, bool(recording.joint_names))
    return FreeBaseIdentification(
        lib=lib,
        pi=fit.pi,
        root=root,
        share=shares,
        rows=rows,
        row_names=names,
        rms=level,
        before=rms(tested.samples.rigid(lib, lib.pi0) - measured),
        after=after,
        n_train=len(train),
        n_test=len(test),
        n_eff=float(fit.n_eff or len(train)),
        seconds=float(test.t[-1] - test.t[0]),
        status=fit.status,
        notes=(*fit.notes, *notes),
        offset_mass=offset_mass,
        sensors=sensors,
        vertical=vertical_force(lib, test, fit.pi, fit.phi),
    )


def _posterior(problem: Problem, fit: Fit, prior: PriorFile | None) -> tuple[Array, Array]:
    """Root of the covariance and share of the prior, as `estimators.uncertainty` computes them."""
    lib, (_, noise) = problem.lib, fit.noise()
    if fit.statistics is None:
        raise IdentificationError("expected statistics of the fit; use the method map")
    level = max(noise.density, float(np.finfo(float).tiny))
    statistics = fit.statistics
    if problem.friction_prior is not None:
        known = problem.friction_prior.statistics(statistics, level)
        statistics = statistics.merged(known)
    data, _ = reduce(statistics, problem.train.equations)
    rows, target = data.factor / np.sqrt(level), data.target / np.sqrt(level)
    kappa = prior.kappa if prior and prior.kappa else CAD
    spread = spread_of(bodies_of(lib), fit.pi, rows, kappa)
    reference, _ = vague_posterior(lib, prior_of(lib, lib.pi0), rows, target)
    return np.column_stack([spread.root, fit.pi - reference]), spread.share


def _shown(tested: FreeBaseRows) -> tuple[tuple[str, ...], Array]:
    """Names and right side of the rows whose errors are stated."""
    left = tested.samples.equations
    if left == len(tested.names):
        return tested.names, tested.samples.tau
    return tuple(f"equation {k + 1}" for k in range(left)), tested.samples.tau


def free_base_facts(result: FreeBaseIdentification, command: str) -> dict[str, Any]:
    """JSON-ready facts of result.json."""
    total, sigma = result.mass
    vertical = result.vertical
    facts: dict[str, Any] = {
        "free_base": 1,
        "command": command,
        "robot": result.lib.name,
        "model_hash": result.lib.manifest.model_hash,
        "rows": result.rows,
        "n_train": result.n_train,
        "n_test": result.n_test,
        "n_eff": result.n_eff,
        "status": result.status,
        "notes": list(result.notes),
        "total_mass": {
            "value": total,
            "sigma": sigma,
            "interval": [total - NORMAL_95 * sigma, total + NORMAL_95 * sigma],
            "urdf": float(mass(links(result.lib.pi0)).sum()),
        },
        "errors": [
            {"row": name, "rms": r, "before": b, "after": a}
            for name, r, b, a in zip(
                result.row_names,
                result.rms.tolist(),
                result.before.tolist(),
                result.after.tolist(),
                strict=True,
            )
        ],
        "vertical_force": None
        if vertical is None
        else {
            "mean": vertical.weight,
            "before_percent": 100 * vertical.before / abs(vertical.weight),
            "after_percent": 100 * vertical.after / abs(vertical.weight),
        },
        "sensors": result.sensors,
        "links": _links(result),
        "pi": result.pi.tolist(),
        "sigma": np.linalg.norm(result.root, axis=1).tolist(),
        "verdicts": list(result.verdicts),
        "beta": (result.lib.base_matrix @ result.pi).tolist(),
    }
    return facts


def _links(result: FreeBaseIdentification) -> list[dict[str, Any]]:
    lib, size = result.lib, len(PI_NAMES)
    sigma = np.linalg.norm(result.root, axis=1)
    com = com_sigma(result.root, result.pi)
    rows = []
    for k, (name, pi) in enumerate(zip(lib.link_names, links(result.pi), strict=True)):
        verdicts = result.verdicts[k * size : (k + 1) * size]
        spread = com[k]
        rows.append(
            {
                "link": name,
                "mass": float(mass(pi)),
                "mass_sigma": float(sigma[k * size]),
                "com": centre_of_mass(pi).tolist(),
                "com_sigma": None if spread is None else np.asarray(spread).tolist(),
                "inertia": inertia(pi).tolist(),
                "not_identifiable": [
                    entry
                    for entry, verdict in zip(PI_NAMES, verdicts, strict=True)
                    if verdict == PRIOR_DOMINATED
                ],
            }
        )
    return rows


def write_free_base(result: FreeBaseIdentification, folder: Path, command: str) -> dict[str, Any]:
    """Write result.json into a folder."""
    facts = free_base_facts(result, command)
    text = json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    with replacing(folder / "result.json") as file:
        file.write(text.encode())
    return facts
