"""The result of a robot with a free base: what its files hold, and what they come from.

Friction and armature are the friction of the record, the delay of the torques is its delay.
Coefficients of sensors, and the delay, are eliminated from the posterior that is written.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from runtime.estimators import uncertainty as spreads
from runtime.estimators.convex.entropic_prior import Prior, prior_about
from runtime.estimators.problem import OF, Fit, NoiseFloor
from runtime.estimators.regression.factor import Elimination, Reduced, Statistics, reduce
from runtime.estimators.regression.samples import NORMAL_95, Samples, residuals
from runtime.identification import result_record as schema
from runtime.identification.free_base import rows as equations
from runtime.identification.free_base.drives import rms
from runtime.identification.posterior_file import SavedPosterior
from runtime.identification.saved_result import SavedResult
from runtime.identification.settings import Settings
from runtime.library import Array, Library
from runtime.library.parameters import MASS, N_PARAMETERS, links, mass
from runtime.recording.free_base import FreeBaseRecording
from runtime.recording.preprocessing.free_base_motion import FreeBaseMotion, motion_of
from runtime.recording.recipes.recipe import MEASURED

MOST_NAMES = 6  # of links that a sentence lists


@dataclass(frozen=True, eq=False)  # no slots: what it determines is computed once and kept
class Evidence:
    """Fit to the equations of some instants: rows that train and priors, about an estimate."""

    lib: Library
    fit: Fit
    statistics: Statistics  # of the rows over their noise
    known: Statistics | None  # prior of φ as rows
    level: float  # S, variance with which the noise enters the unknowns
    settings: Settings  # with the prior of the bodies, and the method
    slopes: Array  # of constant offsets of sensors of σ
    inflation: float  # N / N_eff
    seconds: float  # duration of the rows [s]
    of_drives: slice  # places of the friction coefficients in φ, joint by joint
    noise: NoiseFloor | None  # of the URDF's residual, where it is not that of the fit
    notes: tuple[str, ...]

    def predicted(self, rows: Samples) -> Array:
        """Right side of other rows, (N, m)."""
        return rows.tau + residuals(self.lib, rows, self.fit.pi, self.fit.phi)

    @property
    def prior(self) -> Prior:
        """Entropic prior of the bodies."""
        return prior_about(self.lib, self.lib.pi0, self.settings.centre)

    def after(self, times: float = 1.0) -> tuple[Statistics, Reduced, Elimination, spreads.Spread]:
        """Least squares, without φ, and spread of π after `times` the time of the same motion."""
        data = self.statistics.repeated(times)
        if self.known is not None:
            data = data.merged(self.known)
        reduced, eliminated = reduce(data, self.lib.n_rows)
        spread = spreads.laplace(
            *(self.lib, data, reduced, self.level, self.fit.pi, self.prior, self.settings.kappa),
            times * self.slopes,
            is_most_probable=self.settings.estimator.is_most_probable,
        )
        return data, reduced, eliminated, spread

    @cached_property
    def now(self) -> tuple[Statistics, Reduced, Elimination, spreads.Spread]:
        """The same of these rows."""
        return self.after()

    @cached_property
    def posterior(self) -> SavedPosterior:
        """Posterior of π, and of φ of sensors, drives and delay."""
        statistics, _, _, spread = self.now
        kappa, centre = self.settings.kappa, self.prior.centre
        known = spreads.LogInformation(statistics, self.level, kappa, centre)
        root, moved = spread.root, spread.phi_nuisance
        return SavedPosterior(known, self.fit.pi, root, 0, moved, joints=self.lib.n_joints)

    @property
    def phi_root(self) -> Array:
        """Root of the covariance of φ; NaN where the data do not determine it."""
        eliminated, posterior = self.now[2], self.posterior
        root = posterior.phi_rows(eliminated)
        root[eliminated.undetermined] = np.nan
        return root


@dataclass(frozen=True, slots=True, eq=False)
class FreeBaseIdentification(SavedResult):
    """Result of an identification with a free base, with what its files come from.

    Attributes:
        lib: library of the robot.
        evidence: rows that train and priors.
        predictions: t (N,) [s] and measured, before, after (N, k) of the rows on the test part, and
            row marks.
    """

    lib: Library = field(kw_only=True)
    evidence: Evidence = field(kw_only=True)
    predictions: dict[str, Any] = field(kw_only=True)

    @property
    def is_consistent(self) -> bool:
        """Whether every link is physically consistent."""
        return self.record.consistent

    @property
    def posterior(self) -> SavedPosterior:
        """Posterior of π and of the friction, without errors of sensors and the delay."""
        whole, of_drives = self.evidence.posterior, self.evidence.of_drives
        statistics = marginal(whole.information.statistics, of_drives)
        known = replace(whole.information, statistics=statistics)
        return replace(whole, information=known, phi_nuisance=None)


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


def total_mass(evidence: Evidence) -> schema.TotalMass:
    """Mass of the robot; its σ contains the sensors' offsets."""
    total, root = float(mass(links(evidence.fit.pi)).sum()), evidence.posterior.pi_root
    sigma = float(np.linalg.norm(root[MASS::N_PARAMETERS].sum(axis=0)))
    return schema.TotalMass(
        value=total,
        sigma=sigma,
        interval=(total - NORMAL_95 * sigma, total + NORMAL_95 * sigma),
        urdf=float(mass(links(evidence.lib.pi0)).sum()),
    )


def uncertainty_of(evidence: Evidence) -> schema.UncertaintyPart:
    """Posterior of π."""
    lib, spread = evidence.lib, evidence.now[3]
    base, share = lib.base_matrix, spread.by_kappa.share
    verdicts = spread.verdicts(base)
    rank, weakest = spreads.excited_directions(lib, evidence.statistics, lib.n_rows)
    masses = zip(lib.link_names, verdicts[::N_PARAMETERS], strict=True)
    prior = [name for name, verdict in masses if verdict != spreads.IDENTIFIED]
    listed = ", ".join(prior) if len(prior) <= MOST_NAMES else f"{len(prior)} links"
    return schema.uncertainty_part(
        *(lib, evidence.fit.pi, evidence.posterior.pi_root, share, verdicts),
        advice=f"the log hardly determines the mass of {listed}: measure the wrenches of the "
        "contacts, or record a motion that moves these links"
        if prior
        else "the log determines the masses of all links",
        n_eff=evidence.statistics.n_samples / evidence.inflation,
        inflation=evidence.inflation,
        excited=rank,
        weakest_direction=weakest,
        beta_verdicts=spread.beta_verdicts(base),
        noise=(),
        model_band=(),
        white_lag_share=(),
    )


def rows_by_result(
    recording: FreeBaseRecording,
    lib: Library,
    saved: SavedResult,
    cutoff_hz: float | None,
    most: int | None = None,
) -> tuple[FreeBaseMotion, equations.FreeBaseRows, Array]:
    """Equations of another log, at most `most` instants, and φ of all columns."""
    record, drives, late = saved.record, None, 0.0
    # What a commanded torque loses in the drives, a measured one need not.
    of_drives = record.torque_source == MEASURED and (record.friction or record.delays)
    if recording.is_commanded:
        recording, _ = equations.with_contact_states(recording, lib)
    if recording.is_commanded or of_drives:
        late = next((each.value for each in record.delays if isinstance(each.value, float)), 0.0)
        drives = equations.Drives(saved.friction, delay_s=late)
    terms = None if drives is None else saved.friction
    motion = motion_of(recording, lib.joint_names, cutoff_hz, late, terms)
    # At the ends the low-pass and the shift by the delay lack samples.
    ends = max(late, 0.0 if cutoff_hz is None or drives is None else 1.0 / cutoff_hz)
    inside = (motion.t >= motion.t[0] + ends) & (motion.t <= motion.t[-1] - ends)
    step = 1 if most is None else max(1, -(-int(inside.sum()) // most))
    motion = motion.rows(np.flatnonzero(inside)[::step])
    known = record.sensors or {}
    # Of several logs the mean of their offsets.
    sensors = [
        np.mean([x.value or 0.0 for key, x in known.items() if key.partition(OF)[0] == name] or [0])
        for name, _ in equations.sensor_errors(motion.contacts)
    ]
    phi = np.concatenate([np.array(sensors, dtype=float), saved.phi.ravel() if drives else []])
    return motion, equations.rows_of(lib, motion, record.rows or "all", drives), phi


def free_base_errors(
    recording: FreeBaseRecording, lib: Library, saved: SavedResult, cutoff_hz: float | None
) -> tuple[tuple[str, ...], dict[str, list[float]]]:
    """RMS of the rows of another log, low-passed at the cut-off [Hz], with the names of the rows.

    `size` is that of forces and torques, `before` that of errors of the URDF, and `after` that of
    errors of the result with friction, delay and errors of sensors.
    """
    _, rows, phi = rows_by_result(recording, lib, saved, cutoff_hz)
    names, shown = rows.shown()
    before = residuals(lib, shown, lib.pi0, np.zeros(0))
    after = residuals(lib, shown, saved.pi, phi)
    each = {"size": shown.tau, "before": before, "after": after}
    return names, {key: rms(values).tolist() for key, values in each.items()}
