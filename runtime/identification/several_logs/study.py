"""One fit to several logs, and what the logs say about each other.

Leave one out: the answer of all other logs predicts the one that is left. Repeatability: every log
alone is fitted, and the spread of the base parameters is held against what their own covariances
promise; a ratio above one says that the logs differ by more than noise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.descent.drivers import Preset
from runtime.estimators.methods import require_method
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.regression.residuals import residuals
from runtime.estimators.regression.samples import samples_of
from runtime.identification.metrics import TorqueError, torque_error
from runtime.identification.problem_setup import assemble
from runtime.identification.several_logs.joint_fit import (
    OFFSET,
    Session,
    joined,
    prepared_of,
    shared_terms,
)
from runtime.identification.single_log import Identification, identify_assembled
from runtime.library import Array, Library
from runtime.library.parameters import links, mass
from runtime.parallel import one_blas_thread
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.friction import geared
from runtime.recording.preprocessing import split

UNSUITED = {"iv", "didim", "ekf", "ukf", "nn"}
"""Methods that simulate or filter one unfiltered run."""
AGREEING = 2.0
"""Ratio of spread to promise below which logs agree; three logs scatter it by a third."""


@dataclass(frozen=True, slots=True)
class Held:
    """A log as all the others predict it.

    Attributes:
        before: torque error of the URDF.
        after: of the answer of the others, with their mean offset.
        own_offset: the same with the offset of this log, the mean of its residual.
        alone: overall error in % of the log's own fit, on the same rows.
    """

    name: str
    before: TorqueError
    after: TorqueError
    own_offset: TorqueError
    alone: float


@dataclass(frozen=True, slots=True)
class Study:
    """What the logs say about each other.

    Attributes:
        names: of the logs.
        carried: kg of known payload per log.
        samples: training rows per log.
        offsets: of each log in the fit of all, (logs, n); None without offset columns.
        held: leave-one-out.
        masses: of the links by every log alone, (logs, n).
        spread: standard deviation of each base parameter over the logs, (n_b,).
        promised: what their own covariances promise, (n_b,).
    """

    names: tuple[str, ...]
    carried: tuple[float, ...]
    samples: tuple[int, ...]
    offsets: Array | None
    held: tuple[Held, ...]
    masses: Array
    spread: Array
    promised: Array

    @property
    def ratio(self) -> float:
        """Root mean square of spread over promise."""
        known = self.promised > 0
        return float(np.sqrt(np.mean((self.spread[known] / self.promised[known]) ** 2)))

    def sentence(self) -> str:
        """What the spread of the logs says."""
        told = (
            "the logs agree as well as their noise promises"
            if self.ratio < AGREEING
            else "the logs differ by more than noise: temperature, cables, a payload or a clock "
            "changed between them"
        )
        return (
            f"base parameters of single logs spread {self.ratio:.2g} times what their covariances "
            f"promise, link masses up to {float(np.std(self.masses, axis=0, ddof=1).max()):.2g} "
            f"kg; {told}"
        )

    def facts(self) -> dict[str, Any]:
        """JSON-ready."""
        return {
            "names": list(self.names),
            "payload_kg": list(self.carried),
            "train_samples": list(self.samples),
            "offsets": None if self.offsets is None else self.offsets.tolist(),
            "leave_one_out": [
                {
                    "name": held.name,
                    "before_overall": held.before.overall,
                    "after_overall": held.after.overall,
                    "own_offset_overall": held.own_offset.overall,
                    "alone_overall": held.alone,
                    "rms": held.after.rms.tolist(),
                }
                for held in self.held
            ],
            "repeatability": {
                "masses": self.masses.tolist(),
                "mass_spread": np.std(self.masses, axis=0, ddof=1).tolist(),
                "beta_spread": self.spread.tolist(),
                "beta_promised": self.promised.tolist(),
                "ratio": self.ratio,
                "sentence": self.sentence(),
            },
        }


@one_blas_thread
def identify_sessions(
    sessions: Sequence[Session],
    lib: Library,
    method: str | None = None,
    *,
    preset: str | Preset | None = None,
    splitting: Split | None = None,
    friction_columns: Friction | None = None,
    prior: PriorFile | None = None,
    seed: int = 0,
    progress: Callable[[int, float], None] | None = None,
) -> tuple[Identification, Study]:
    """One answer to all logs, each split like a single one, and the study of the logs.

    Args:
        sessions: two or more.
        lib: of the robot.
        method: as for `identify`; none that needs one unfiltered run.
        preset: settings of "adam".
        splitting: of every log.
        friction_columns: default is those of the first log's recipe; an offset becomes one per log.
        prior: further knowledge, for "map".
        seed: of mini-batches.
        progress: called with iteration and best validation loss.

    Raises:
        RuntimeFault: the logs or options do not make an identification problem.
    """
    method = method or ("map" if preset is None else "adam")
    require_method(method)
    names = [session.name for session in sessions]
    if len(set(names)) < max(len(names), 2):
        raise IdentificationError(
            f"expected two logs or more with names of their own, got {', '.join(names)}"
        )
    if method in UNSUITED:
        raise IdentificationError(
            f"'{method}' follows one unfiltered run and cannot join several logs; use map, adam, "
            "pc-ols, ols or wls"
        )
    first = sessions[0].recording
    recipe = first.recipe
    terms = friction_columns or (recipe.friction if recipe else None) or Friction(columns=())
    terms = geared(terms, first)
    logs = [prepared_of(session, lib, terms) for session in sessions]
    parts = splitting or (recipe.split if recipe else None) or Split()
    fit = _Fit(lib, method, preset, prior, terms, seed)
    cut = [split(log, parts) for log in logs]
    train, validation, test = (joined([each[k] for each in cut], names, names) for k in range(3))
    result = fit.of(train, validation, test, progress=progress)
    offsets = None
    if OFFSET in terms.columns:
        offsets = result.phi[:, -len(names) :].T
        usual = replace(terms, columns=(*shared_terms(terms), OFFSET))
        result = replace(result, friction=usual, sessions=tuple(names))
    bare = [joined([log], [name], [name]) for log, name in zip(logs, names, strict=True)]
    singles = [fit.of(one, one, one) for one in bare]
    masses = [mass(links(single.pi)) for single in singles]
    sigma = [single.uncertainty.beta_sigma for single in singles if single.uncertainty is not None]
    study = Study(
        names=tuple(names),
        carried=tuple(_mass(session, lib) for session in sessions),
        samples=tuple(len(each[0]) for each in cut),
        offsets=offsets,
        held=tuple(_held(k, logs, names, fit, single) for k, single in enumerate(singles)),
        masses=np.array(masses),
        spread=np.std([single.beta for single in singles], axis=0, ddof=1),
        promised=np.sqrt(np.mean(np.square(sigma), axis=0)),
    )
    return result, study


@dataclass(frozen=True, slots=True)
class _Fit:
    """The same fit of any logs."""

    lib: Library
    method: str
    preset: str | Preset | None
    prior: PriorFile | None
    terms: Friction
    seed: int

    def of(
        self,
        train: Recording,
        validation: Recording,
        test: Recording,
        certify: bool = True,
        progress: Callable[[int, float], None] | None = None,
    ) -> Identification:
        """The answer to prepared recordings."""
        assembly = assemble(
            train,
            self.lib,
            preparation=Preparation(),
            friction_columns=replace(self.terms, columns=shared_terms(self.terms)),
            validation=validation,
            test=test,
            seed=self.seed,
            progress=progress,
        )
        return identify_assembled(
            assembly, self.method, preset=self.preset, prior=self.prior, certify=certify
        )


def _held(
    index: int, logs: Sequence[Recording], names: Sequence[str], fit: _Fit, own: Identification
) -> Held:
    """Errors on all rows of a log of the answer that the others give."""
    name, log, lib = names[index], logs[index], fit.lib
    other_names = [each for each in names if each != name]
    rest = joined([each for each in logs if each is not log], other_names, other_names)
    others = fit.of(rest, rest, rest, certify=False)
    samples = samples_of(joined([log], [name], [name]), lib)
    phi = others.phi
    if OFFSET in log.column_names:
        phi = replace(others, sessions=tuple(other_names)).usual_phi
    tau = samples.tau
    before = tau + residuals(lib, samples, lib.pi0, np.zeros(0))
    after = tau + residuals(lib, samples, others.pi, phi)
    settled = after - np.mean(after - tau, axis=0)
    alone = tau + residuals(lib, samples, own.pi, own.phi)
    errors = [torque_error(tau, each) for each in (before, after, settled, alone)]
    return Held(name, errors[0], errors[1], errors[2], errors[3].overall)


def _mass(session: Session, lib: Library) -> float:
    if session.carried is None:
        return 0.0
    return float(mass(links(session.carried)).sum())
