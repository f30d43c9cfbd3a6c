"""Identification of a robot with a free base: most probable consistent bodies, and their intervals.

The rows of `rows` are given to the method map (entropic prior at the URDF, the base link included),
so that what the log does not determine keeps the values of the URDF, and says so.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from runtime.common.threads import one_blas_thread
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD, bodies_of, prior_of, spread_of
from runtime.estimators.friction_bounds import OF
from runtime.estimators.methods import fit_by
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import Fit, FrictionPrior, Problem
from runtime.estimators.regression.factor import reduce
from runtime.estimators.uncertainty import LogInformation, nuisance_of_slopes, vague_posterior
from runtime.identification.free_base.drives import (
    COLUMNS,
    LATEST_S,
    RowNoise,
    drives_of,
    noise_of,
    problem_of,
    rms,
    unit_noise,
    vertical_force,
)
from runtime.identification.free_base.plausibility import (
    notes_on_errors,
    require_clock,
    require_contact_conventions,
    require_forces_on_robot,
    require_joint_units,
    require_prior_of_bodies,
    require_torque_sign,
)
from runtime.identification.free_base.result import (
    FreeBaseIdentification,
    percent_of,
    total_mass,
    uncertainty_of,
)
from runtime.identification.free_base.rows import (
    OFFSET_SIGMA,
    Drives,
    FreeBaseRows,
    rows_of,
    sensor_errors,
    with_contact_states,
)
from runtime.identification.posterior_file import SavedPosterior
from runtime.identification.result_file import provenance_of
from runtime.identification.result_record import (
    FORMAT,
    Coefficient,
    Delay,
    ErrorRms,
    FrictionPart,
    RecordingPart,
    ResultRecord,
    link_parts,
    plain,
)
from runtime.identification.saved_result import model_part
from runtime.library import Array, Library
from runtime.library.manifest import file_units
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion, motion_of
from runtime.recording.recipes.recipe import COMMANDED, MEASURED
from runtime.recording.row_marks import row_marks
from runtime.recording.settings import Friction

SHARE = 0.6
"""Share of the log that is trained on."""
ROWS_PER_PERIOD = 5.0
"""Rows per period of the cut-off of a commanded log."""


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
    friction: tuple[str, ...] = COLUMNS,
    delay_s: float | None = None,
) -> FreeBaseIdentification:
    """Identify π of a robot with a free base; a delay of commands is estimated unless stated."""
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
    data = _prepared(recording, lib, rows, cutoff_hz, (share, trim_s), friction, delay_s, prior)
    motion, drives, trained, tested = data.motion, data.drives, data.trained, data.tested
    known = sensor_errors(motion.contacts)
    sensor_names, spread = [name for name, _ in known], [sigma for _, sigma in known]
    sensed = None
    if known:
        sigma = np.full(trained.samples.shape, np.inf)
        sigma[0, : len(known)] = spread
        sensed = FrictionPrior(np.zeros_like(sigma), sigma)
    columns = tuple(f"error{OF}{name}" for name in sensor_names)
    fitted, offsets, noise = trained.samples, trained.offsets, None
    if drives is None:
        span = float(data.train.t[-1] - data.train.t[0])
        noise = noise_of(lib, trained, sensed, cutoff_hz, span)
        floor = None if noise is None else noise.floor
        if noise is not None:
            fitted = fitted.weighted(noise.weights)
            offsets = offsets * np.sqrt(noise.weights)[:, None, None]
    else:
        columns, floor = (*columns, *drives.names(lib.joint_names)), unit_noise(fitted)
    problem = problem_of(lib, fitted, tested.samples, columns, floor, sensed)
    fit = fit_by(problem, "map", None, prior)
    posterior, shares, deviations = _posterior(problem, fit, prior, offsets)
    names, shown = tested.shown(drives is not None)
    measured = tested.samples.tau
    level = rms(shown(measured))
    by_columns = tested.samples.columns @ fit.phi[0]
    by_urdf = tested.samples.rigid(lib, lib.pi0)
    by_result = tested.samples.rigid(lib, fit.pi) + by_columns
    before, after = (rms(shown(each - measured)) for each in (by_urdf, by_result))
    size, n_train = len(sensor_names), len(data.train)
    sensors = dict(zip(sensor_names, fit.phi[0, :size].tolist(), strict=True))
    eigenvalues = lib.relative_eigenvalues(fit.pi)
    is_consistent, units = bool(eigenvalues.min() > 0), file_units(lib.manifest)
    of_rows = dict(zip(lib.row_names, [*["N"] * 3, *["N*m"] * 3, *units], strict=True))
    filtered = {} if cutoff_hz is None else {"filter": "butterworth", "cutoff_hz": cutoff_hz}
    of_drives, delay = (fit.phi[0, size:], deviations[size:]), None
    if drives is not None:  # a stated delay is exact
        late, spread_s = (x[-1] if drives.is_delay_unknown else 0.0 for x in of_drives)
        delay = Delay(value=drives.delay_s + float(late), sigma=plain(float(spread_s)))
    record = ResultRecord.with_gaps(
        format=FORMAT,
        method="map",
        robot=lib.name,
        base="free",
        model=model_part(lib),
        status=fit.status,
        joints=lib.joint_names,
        units=tuple(units),
        recording=RecordingPart.with_gaps(
            name=recording.name,
            duration=float(motion.t[-1] - motion.t[0]),
            samples={"train": n_train, "validation": 0, "test": len(data.test)},
            preparation=filtered,
        ),
        torque_source=MEASURED if drives is None else COMMANDED,
        delay_s=delay,
        torque_error_percent=percent_of(level, before, after),
        torque_rms=ErrorRms(before=plain(before), after=plain(after)),
        links=link_parts(lib, fit.pi, eigenvalues),
        consistent=is_consistent,
        uncertainty=uncertainty_of(
            *(lib, posterior.pi_root, fit.pi, eigenvalues, shares),
            n_train / float(fit.n_eff or n_train),
            n_train,
        ),
        friction=None if drives is None else _friction(drives, lib.n_joints, *of_drives),
        warnings=(
            *fit.notes,
            *_notes(lib, recording, data, noise),
            *notes_on_errors(level, after, sensors, spread, bool(recording.joint_names)),
        ),
        pi=plain(fit.pi),
        lam=plain(lib.lam_from_pi(fit.pi)) if is_consistent else None,
        beta=plain(lib.base_matrix @ fit.pi),
        provenance=provenance_of(lib, "", {}, None),
        rows=rows,
        error_rows=names,
        error_units=tuple(of_rows.get(name, "") for name in names),
        total_mass=total_mass(lib, fit.pi, posterior.pi_root),
        vertical_force=vertical_force(lib, data.test, fit.pi, fit.phi[:, :size]),
        sensors={
            name: Coefficient(value=value, sigma=plain(sigma))
            for (name, value), sigma in zip(sensors.items(), deviations[:size], strict=True)
        }
        or None,
    )
    predictions = {"t": data.test.t, "measured": measured, "before": by_urdf, "after": by_result}
    return FreeBaseIdentification(
        lib,
        fit.pi,
        record,
        posterior,
        level,
        float(data.test.t[-1] - data.test.t[0]),
        {key: each if key == "t" else shown(each) for key, each in predictions.items()}
        | {"row_marks": row_marks(recording.joints)},
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Prepared:
    """Motion and equations of both parts, with sentences on the contacts."""

    motion: FreeBaseMotion
    drives: Drives | None
    train: FreeBaseMotion
    test: FreeBaseMotion
    trained: FreeBaseRows
    tested: FreeBaseRows
    notes: tuple[str, ...]


def _prepared(
    recording: FreeBaseRecording,
    lib: Library,
    rows: str,
    cutoff_hz: float | None,
    cut: tuple[float, float],
    friction: tuple[str, ...],
    delay_s: float | None,
    prior: PriorFile | None,
) -> _Prepared:
    """Equations of a log that agree with the robot; cut as in `_parts`."""
    drives: Drives | None = None
    notes: tuple[str, ...] = ()
    if recording.is_commanded:
        recording, notes = with_contact_states(recording, lib)
        cut = cut[0], max(cut[1], LATEST_S, 0.0 if cutoff_hz is None else 1.0 / cutoff_hz)

        def trained_part(motion: FreeBaseMotion) -> NDArray[np.int64]:
            return _parts(motion, *cut)[0]

        terms = Friction(friction)
        drives = drives_of(recording, lib, rows, terms, delay_s, cutoff_hz, trained_part, prior)
    late, columns = (0.0, None) if drives is None else (drives.delay_s, drives.terms)
    motion = motion_of(recording, lib.joint_names, cutoff_hz, late, columns)
    require_joint_units(lib, motion, recording.name)
    first, second = _parts(motion, *cut)
    if drives is not None and cutoff_hz is not None:
        # More rows than these of a low-pass contain nothing new.
        period = 1.0 / (cutoff_hz * float(np.median(np.diff(motion.t))))
        step = max(1, int(period / ROWS_PER_PERIOD))
        first, second = first[::step], second[::step]
    train, test = motion.rows(first), motion.rows(second)
    trained, tested = (rows_of(lib, part, rows, drives) for part in (train, test))
    if drives is None:
        require_forces_on_robot(lib, trained, recording.name)
    require_contact_conventions(lib, train, recording.name)
    require_torque_sign(lib, train, recording.name)
    return _Prepared(motion, drives, train, test, trained, tested, notes)


def _notes(
    lib: Library, recording: FreeBaseRecording, data: _Prepared, noise: RowNoise | None
) -> tuple[str, ...]:
    trained, notes = data.trained, list(data.notes)
    if noise is not None:
        independent = trained.samples.tau.size / noise.floor.inflation
        notes.append(
            f"{independent:.0f} independent equations for {len(lib.base_columns)} base parameters: "
            "most of the result is the prior, and the residual of the URDF counts as noise, "
            "without its mean and errors of sensors"
        )
    if trained.offsets.size:
        force, moment = OFFSET_SIGMA[[0, -1]]
        notes.append(
            f"intervals contain constant offsets of the contact sensors of {force:g} N and "
            f"{1e3 * moment:g} mN·m (σ): an offset of a force changes the total mass by as much; "
            "state the standard deviation of those of vertical forces in N by contact_force_z_sigma"
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
    return tuple(notes)


def _parts(
    motion: FreeBaseMotion, share: float, trim_s: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Instants of the training and of the test, without `trim_s` [s] at either end."""
    first, last = motion.t[0] + trim_s, motion.t[-1] - trim_s
    inside = np.flatnonzero((motion.t >= first) & (motion.t <= last))
    border = motion.t[0] + share * (motion.t[-1] - motion.t[0])
    first, second = inside[motion.t[inside] < border], inside[motion.t[inside] >= border]
    if min(len(first), len(second)) < 1:
        raise IdentificationError("no row is left for training or test; record for longer")
    return first, second


def _friction(drives: Drives, joints: int, phi: Array, sigma: Array) -> FrictionPart | None:
    """Friction and armature of commanded torques, (n, k)."""
    columns = drives.terms.columns
    if not columns:
        return None
    values, spread = (x[: joints * len(columns)].reshape(joints, -1) for x in (phi, sigma))
    return FrictionPart(
        columns=columns,
        values=plain(values),
        coulomb_speed=drives.terms.coulomb_speed,
        sigma=plain(spread),
    )


def _posterior(
    problem: Problem, fit: Fit, prior: PriorFile | None, offsets: Array
) -> tuple[SavedPosterior, Array, Array]:
    """Posterior, share of the prior in π, and σ of φ; offsets (N, m, o) move both."""
    lib, (weights, noise) = problem.lib, fit.noise()
    level = max(noise.density, float(np.finfo(float).tiny))
    statistics = fit.statistics or problem.statistics()
    if problem.friction_prior is not None:
        known = problem.friction_prior.statistics(statistics, level)
        statistics = statistics.merged(known)
    data, eliminated = reduce(statistics, problem.train.equations)
    rows, target = data.factor / np.sqrt(level), data.target / np.sqrt(level)
    kappa = prior.kappa if prior and prior.kappa else CAD
    spread = spread_of(bodies_of(lib), fit.pi, rows, kappa)
    reference, _ = vague_posterior(lib, prior_of(lib, lib.pi0), rows, target)
    samples = problem.train
    columns = np.concatenate([samples.base_rows(lib), samples.friction_rows()], axis=2)
    slopes = np.einsum("nmp,m,nmo->po", columns, weights, offsets, optimize=True)
    moved, phi_moved = nuisance_of_slopes(lib, statistics, slopes, level, spread.root)
    root = np.column_stack([spread.root, moved, fit.pi - reference])
    information = LogInformation(statistics, level, kappa, lib.pi0)
    posterior = SavedPosterior(information, fit.pi, root, lib.n_joints, 0, phi_moved)
    sigma = np.linalg.norm(
        np.hstack([posterior.phi_over(eliminated), posterior.phi_root(eliminated)]), axis=1
    )
    sigma[eliminated.undetermined] = np.inf  # the data do not determine them
    return posterior, spread.share, sigma
