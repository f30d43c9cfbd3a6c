"""The result of a robot with a free base as result.json, predictions.npz and posterior.npz.

Friction and armature of commanded torques are the friction of the record, their delay is its delay.
Coefficients of sensors, and the delay, are eliminated from the posterior.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from runtime.estimators.classical.pc_ols import BOUNDARY
from runtime.estimators.convex.entropic_prior import com_sigma
from runtime.estimators.friction_bounds import OF
from runtime.estimators.regression.factor import Statistics
from runtime.estimators.regression.samples import NORMAL_95
from runtime.estimators.uncertainty import PRIOR_DOMINATED
from runtime.identification.free_base.drives import rms
from runtime.identification.free_base.identify import FreeBaseIdentification
from runtime.identification.free_base.rows import (
    DELAY,
    Drives,
    error_names,
    rows_of,
    with_contact_states,
)
from runtime.identification.result_file import provenance_of, require_size, write_files
from runtime.identification.result_record import (
    FORMAT,
    Coefficient,
    Delay,
    ErrorPercent,
    ErrorRms,
    FrictionPart,
    RecordingPart,
    ResultRecord,
    TotalMass,
    UncertaintyPart,
    VerticalForcePart,
    link_parts,
    link_uncertainties,
    plain,
)
from runtime.identification.saved_result import SavedResult, model_part
from runtime.library import Array, Library
from runtime.library.manifest import file_units
from runtime.library.parameters import N_PARAMETERS, links, mass
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.preprocessing.free_base_motion import motion_of
from runtime.recording.recipes.recipe import COMMANDED, MEASURED
from runtime.recording.settings import Friction


def record_of(result: FreeBaseIdentification, command: str) -> ResultRecord:
    """Record of an identification with a free base."""
    lib, units = result.lib, file_units(result.lib.manifest)
    of_rows = dict(zip(lib.row_names, [*["N"] * 3, *["N*m"] * 3, *units], strict=True))
    eigenvalues = lib.relative_eigenvalues(result.pi)
    sizes = np.where(result.rms > 0, result.rms, np.nan)
    late = result.drives.get(DELAY)
    return ResultRecord.with_gaps(
        format=FORMAT,
        method="map",
        robot=lib.name,
        base="free",
        model=model_part(lib),
        status=result.status,
        joints=lib.joint_names,
        units=tuple(units),
        recording=RecordingPart.with_gaps(
            name=result.name,
            duration=result.duration,
            samples={"train": result.n_train, "validation": 0, "test": result.n_test},
            preparation={}
            if result.cutoff_hz is None
            else {"filter": "butterworth", "cutoff_hz": result.cutoff_hz},
        ),
        torque_source=MEASURED if late is None else COMMANDED,
        delay_s=None if late is None else Delay(value=late[0], sigma=plain(late[1])),
        torque_error_percent=ErrorPercent(
            before=plain(100 * result.before / sizes),
            after=plain(100 * result.after / sizes),
            before_overall=_share(result.before, result.rms),
            after_overall=_share(result.after, result.rms),
        ),
        torque_rms=ErrorRms(before=plain(result.before), after=plain(result.after)),
        links=link_parts(lib, result.pi, eigenvalues),
        consistent=result.is_consistent,
        uncertainty=_uncertainty(result, eigenvalues),
        friction=_friction(result),
        warnings=result.notes,
        pi=plain(result.pi),
        lam=plain(lib.lam_from_pi(result.pi)) if result.is_consistent else None,
        beta=plain(lib.base_matrix @ result.pi),
        provenance=provenance_of(lib, command, {}, None),
        rows=result.rows,
        error_rows=result.row_names,
        error_units=tuple(of_rows.get(name, "") for name in result.row_names),
        total_mass=_total_mass(result),
        vertical_force=_vertical(result),
        sensors={
            name: Coefficient(value=value, sigma=plain(result.sensor_sigma[name]))
            for name, value in result.sensors.items()
        }
        or None,
    )


def write_free_base(result: FreeBaseIdentification, folder: Path, command: str) -> ResultRecord:
    """Write result.json, predictions.npz and posterior.npz into a folder."""
    record = record_of(result, command)
    friction = record.friction
    require_size(np.concatenate([result.pi, *(friction.values if friction is not None else ())]))
    known = result.posterior.information
    columns = 0 if friction is None else len(friction.columns) * len(record.joints)
    first = len(result.sensors)
    statistics = marginal(known.statistics, slice(first, first + columns))
    known = replace(known, statistics=statistics)
    posterior = replace(result.posterior, information=known, phi_nuisance=None)
    return write_files(record, folder, posterior, result.predictions)


def marginal(statistics: Statistics, kept: slice) -> Statistics:
    """Statistics over [β; φ_kept]: the other columns of φ are eliminated by one QR."""
    base, size = statistics.n_base, len(statistics.target)
    chosen = np.arange(base, size)[kept]
    others = np.setdiff1d(np.arange(base, size), chosen)
    order = np.concatenate([others, np.arange(base), chosen])
    whole = np.column_stack([statistics.factor[:, order], statistics.target])
    triangle = np.asarray(np.linalg.qr(whole, mode="r"))
    left = triangle[len(others) :, len(others) :]
    return replace(statistics, factor=left[:, :-1], target=left[:, -1])


def _share(error: Array, size: Array) -> float | None:
    """Error of all rows together [%]; None without any torque or force."""
    whole = float(np.linalg.norm(size))
    return 100 * float(np.linalg.norm(error)) / whole if whole else None


def _total_mass(result: FreeBaseIdentification) -> TotalMass:
    total, sigma = result.mass
    return TotalMass(
        value=total,
        sigma=sigma,
        interval=(total - NORMAL_95 * sigma, total + NORMAL_95 * sigma),
        urdf=float(mass(links(result.lib.pi0)).sum()),
    )


def _vertical(result: FreeBaseIdentification) -> VerticalForcePart | None:
    vertical = result.vertical
    if vertical is None:
        return None
    return VerticalForcePart(
        mean=vertical.weight,
        before_percent=100 * vertical.before / abs(vertical.weight),
        after_percent=100 * vertical.after / abs(vertical.weight),
    )


def _friction(result: FreeBaseIdentification) -> FrictionPart | None:
    """Friction and armature of commanded torques, (n, k)."""
    names = [name.partition(OF)[0] for name in result.drives if name != DELAY]
    columns = tuple(dict.fromkeys(names))
    if not columns:
        return None
    values = np.array([pair for name, pair in result.drives.items() if name != DELAY])
    phi, sigma = values.reshape(-1, len(columns), 2).transpose(2, 0, 1)
    return FrictionPart(
        columns=columns,
        values=plain(phi),
        coulomb_speed=Friction(columns).coulomb_speed,
        sigma=plain(sigma),
    )


def _uncertainty(result: FreeBaseIdentification, eigenvalues: Array) -> UncertaintyPart:
    lib, sigma = result.lib, np.linalg.norm(result.root, axis=1)
    prior = [name for name, verdict in zip(lib.link_names, result.verdicts[::N_PARAMETERS],
                                           strict=True) if verdict == PRIOR_DOMINATED]  # fmt: skip
    return UncertaintyPart.with_gaps(
        advice=f"the log hardly determines the mass of {', '.join(prior)}: measure the wrenches of "
        "its contacts, or record a motion that moves it"
        if prior
        else "the log determines the masses of all links",
        n_eff=result.n_eff,
        inflation=result.n_train / result.n_eff,
        excited=len(lib.base_columns),
        boundary=bool(np.abs(eigenvalues).min() < BOUNDARY),
        links=link_uncertainties(sigma, com_sigma(result.root, result.pi), result.verdicts),
        pi_sigma=plain(sigma),
        posterior_over_prior=plain(result.share),
        beta_sigma=plain(np.linalg.norm(lib.base_matrix @ result.root, axis=1)),
        noise=(),
        model_band=(),
        white_lag_share=(),
    )


@dataclass(frozen=True, slots=True, eq=False)
class RowErrors:
    """RMS of the right side of k rows, and of their errors, (k,) each."""

    names: tuple[str, ...]  # of the rows
    size: Array  # RMS of the measured forces and torques
    before: Array  # RMS errors of the URDF
    after: Array  # RMS errors of the result, its friction, delay and errors of sensors included


def free_base_errors(
    recording: FreeBaseRecording, lib: Library, saved: SavedResult, cutoff_hz: float | None
) -> RowErrors:
    """Errors of a result on another log of the robot, low-passed at the cut-off [Hz]."""
    record, drives, late = saved.record, None, 0.0
    if recording.is_commanded:
        recording, _ = with_contact_states(recording, lib)
        late = next((each.value for each in record.delays if isinstance(each.value, float)), 0.0)
        drives = Drives(saved.friction, delay_s=late)
    terms = None if drives is None else saved.friction
    motion = motion_of(recording, lib.joint_names, cutoff_hz, late, terms)
    # At the ends the low-pass and the shift by the delay lack samples.
    ends = max(late, 0.0 if cutoff_hz is None or drives is None else 1.0 / cutoff_hz)
    inside = (motion.t >= motion.t[0] + ends) & (motion.t <= motion.t[-1] - ends)
    motion = motion.rows(np.flatnonzero(inside))
    rows = rows_of(lib, motion, record.rows or "all", drives)
    known = record.sensors or {}
    sensors = [known[n].value if n in known else 0.0 for n in error_names(motion.contacts)]
    phi = np.concatenate([np.array(sensors, dtype=float), saved.phi.ravel() if drives else []])
    measured = rows.samples.tau
    after = rows.samples.rigid(lib, saved.pi) + rows.samples.columns @ phi
    names, shown = rows.shown(drives is not None)
    return RowErrors(
        names,
        rms(shown(measured)),
        rms(shown(rows.samples.rigid(lib, lib.pi0) - measured)),
        rms(shown(after - measured)),
    )
