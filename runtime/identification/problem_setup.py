"""Recording, library and settings → one `Problem` and the parts it was made from.

Everything that does not depend on the method happens here: plausibility, preparation, friction
columns, split, weights, first guess. All methods that share an assembly use the same numbers.
Robots whose URDF states no masses take methods that need no inertial prior, or a prior file.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.prior_file import KnownFriction
from runtime.estimators.problem import FrictionPrior, Origin, Problem, mass_unit
from runtime.estimators.regression.samples import Samples, samples_of, thesis_weights
from runtime.identification import settings as fit_settings
from runtime.identification.current_gains import in_torque
from runtime.identification.identified import Identification
from runtime.library import Array, Library
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.consistency import require_plausible
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.friction.columns import ROTOR
from runtime.recording.friction.coupled_motors import geared
from runtime.recording.friction.model import left_out_note, unresolved, without_columns
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.parts import prepared_parts, rows_between
from runtime.recording.preprocessing.pipeline import prepare_power
from runtime.recording.settings import COLUMNS, EVERYTHING

PARTS = ("train", "validation", "test")
Parts = tuple[Recording, Recording, Recording]
WITHOUT_PRIOR = "pc-ols"  # for such a robot: consistent, and convex from any start
NO_MASSES = (  # note on the result of such a robot
    "the URDF states no <inertial>: only base parameters are determined by the data, the masses of "
    "single links are arbitrary, and errors before identification are meaningless"
)


@dataclass(frozen=True, slots=True, eq=False)
class Assembly:
    """An identification problem and the recordings it was made from."""

    problem: Problem  # data, weights and first guess
    parts: Parts  # prepared training, validation and test recording
    friction: Friction  # names and widths of the friction columns
    is_cut: bool = True  # the parts are cut from the same logs; else the test is a log itself
    logs: tuple[str, ...] = ()  # names of several logs; empty for one
    # name of a part → its recordings, one piece at a time, where `parts` hold only some of the
    # rows; None where `parts` are whole
    pieces: Callable[[str], Iterable[Recording]] | None = None
    notes: tuple[str, ...] = ()  # sentences on what was left out
    source_note: str = ""  # sentence on how a streamed log was read, the last one of its result
    is_joined: bool = False  # the training part includes the validation part
    origin: Origin | None = None  # log behind the training samples, to simulate or filter
    # rows of the parts whose errors are stated, where they are not those of the joints
    shown: "ShownRows | None" = None
    # adds to the result what the kind of log has beyond others: figures of all rows of a streamed
    # log, the comparison of several logs. It is given the fit of an assembly
    finish: Callable[[Identification, "FitOfAssembly"], Identification] | None = None

    @property
    def one_run(self) -> bool:
        """Whether the parts belong to one recording."""
        return self.is_cut and not self.logs

    def recordings(self, name: str) -> Iterable[Recording]:
        """All rows of "train", "validation" or "test", one piece at a time."""
        if self.pieces is not None:
            return self.pieces(name)
        return (self.parts[PARTS.index(name)],)


@dataclass(frozen=True, slots=True, eq=False)
class ShownRows:
    """Rows of a free base."""

    samples: dict[str, Samples]  # by the name of the part
    rows: tuple[tuple[str, ...], tuple[str, ...]]  # their names and units


FitOfAssembly = Callable[[Assembly, bool], Identification]  # with or without certificates


def assemble(
    recording: Recording,
    lib: Library,
    settings: fit_settings.Settings | str | None = None,
    *,
    progress: fit_settings.Progress = fit_settings.SILENT,
    is_joined: bool = False,
    **keywords: Any,
) -> Assembly:
    """Prepare, split and weight a recording; samples of validation may be fitted, too."""
    chosen = fit_settings.bare_settings(settings, keywords)
    recording = independent_joints(recording, lib)
    require_plausible(recording, lib)
    preparation = chosen.preparation
    recording, chosen = in_torque(recording, lib, chosen)
    terms = geared(fit_settings.terms_of(recording, chosen), recording, lib)
    usual, is_cut = preparation or recording.preparation, chosen.test is None
    is_joined = is_joined and chosen.validation is None

    def prepared(part: Recording, steps: Preparation | None) -> Recording:
        if part.columns is not None:
            return prepare(part, steps)
        return prepare(independent_joints(part, lib), steps, terms, lib=lib)

    validation, test = chosen.validation, chosen.test
    if (validation is None) != (test is None):
        raise IdentificationError("give both a validation and a test recording, or neither")
    if validation is not None and test is not None:
        first, second, third = (
            prepared(each, preparation) for each in (recording, validation, test)
        )
        parts = first, second, third
    else:
        parts = prepared_parts(
            recording, fit_settings.shares_of(recording, chosen), usual, prepared, is_joined
        )

    def of_power(parts: Parts) -> tuple[Recording, Recording]:
        """Rows of power at the instants of the training and validation parts."""
        if recording.rows is not None or recording.columns is not None:
            raise IdentificationError(
                "expected a recording as read, because rows of energy are computed from the raw "
                "signals, got one that is already prepared; give the log itself"
            )

        def power(part: Recording, steps: Preparation) -> Recording:
            return prepare_power(part, steps, terms, lib=lib)

        if validation is not None:
            whole = power(recording, usual), power(validation, usual)
        else:
            shares = fit_settings.shares_of(recording, chosen)
            whole = prepared_parts(recording, shares, usual, power, is_joined)[:2]
        train, unseen = (
            each.take(np.isin(each.t, part.t), "Took the instants of a part.")
            for each, part in zip(whole, parts, strict=False)
        )
        return train, unseen

    given = parts, lib, chosen, terms, usual.regressor
    by_power = of_power if usual.regressor == "energy" else None
    assembly = assembled(*given, progress=progress, is_joined=is_joined, of_power=by_power)
    trained = fit_settings.shares_of(recording, chosen) if is_cut else EVERYTHING
    span = trained.joined() if is_joined else trained.train
    first, moving = assembly.parts[0], replace(usual, rest_speed=None)
    rounding = np.reshape(np.asarray(assembly.problem.left_out), (lib.n_joints, -1))

    def aligned(other: Recording) -> Samples:
        """Samples of a recording of the same clock, prepared alike, at the rows of the training."""
        seen = other.take(rows_between(other.t, *span), "Took the rows of the training part.")
        done = without_columns(prepared(seen, moving), rounding)

        def at(values: Array) -> Array:
            flat = values.reshape(len(done), -1).T
            taken = np.stack([np.interp(first.t, done.t, row) for row in flat], axis=1)
            return taken.reshape(len(first), *values.shape[1:])

        return samples_of(done.mapped(at, "Taken at the rows of the training.", t=first.t), lib)

    origin = Origin(recording, terms, aligned, (first.t[0], first.t[-1]), chosen.inputs or {})
    return replace(assembly, is_cut=is_cut, origin=origin)


def assembled(
    parts: Parts,
    lib: Library,
    settings: fit_settings.Settings,
    terms: Friction,
    regressor: str,
    *,
    progress: fit_settings.Progress = fit_settings.SILENT,
    is_joined: bool = False,
    of_power: Callable[[Parts], tuple[Recording, Recording]] | None = None,
    pieces: Callable[[str], Iterable[Recording]] | None = None,
) -> Assembly:
    """The problem of prepared parts of any log, or of windows of parts that come in pieces."""
    whole, prior = samples_of(parts[0], lib), settings.prior
    rounding = unresolved(whole.columns, whole.tau)

    def resolved(part: Recording) -> Recording:
        return without_columns(part, rounding)

    def rows(name: str) -> Iterable[Recording]:
        return map(resolved, () if pieces is None else pieces(name))

    train, validation, test = parts = tuple(map(resolved, parts))  # type: ignore[assignment]
    if not samples_of(test, lib).tau.any():
        raise IdentificationError(
            "the torque is 0 throughout the test part, so that no error of a model can be stated; "
            "leave out the rows without power (leave_out of a recipe), or use another --split"
        )
    names = train.column_names
    if of_power is not None:
        train, validation = map(resolved, of_power(parts))
    fitted = samples_of(train, lib)
    equations, unknowns = fitted.tau.size, len(lib.base_columns) + fitted.columns[0].size
    if equations < unknowns:
        raise IdentificationError(
            f"the {len(fitted)} training samples give {equations} equations for {unknowns} "
            "unknowns (base parameters and friction); record for longer, or use a larger share of "
            "the recording for training"
        )
    problem = Problem(
        lib=lib,
        train=fitted,
        validation=samples_of(validation, lib),
        weights=thesis_weights(fitted.tau, mass_unit(lib, lib.pi0)),
        start=lib.lam0 if settings.lam0 is None else np.asarray(settings.lam0, dtype=float),
        seed=settings.seed,
        progress=progress.iteration,
        pieces=None
        if pieces is None
        else lambda name: (samples_of(piece, lib) for piece in rows(name)),
        terms=terms,
        column_names=names,
        left_out=rounding.ravel(),
        friction_prior=known_friction(lib, settings, names, terms),
        noise_floor=prior.noise if prior and regressor == "acceleration" else None,
    )
    notes, given = left_out_note(rounding, lib.joint_names, names), None if pieces is None else rows
    return Assembly(problem, parts, terms, pieces=given, notes=notes, is_joined=is_joined)


def known_friction(
    lib: Library, settings: fit_settings.Settings, columns: tuple[str, ...], friction: Friction
) -> FrictionPrior | None:
    """Prior of the friction coefficients, stated ones before those of the columns."""
    prior, stated = settings.prior, settings.friction_prior
    priors: list[FrictionPrior] = []
    if stated is not None:
        priors = [stated.of(friction, columns) if isinstance(stated, KnownFriction) else stated]
    elif prior is not None:
        if prior.armature is not None:
            if ROTOR.name not in columns:
                raise IdentificationError(
                    "the prior states armature, but rotor inertia is not among the friction "
                    f"columns {', '.join(columns) or 'none'}; add rotor to --friction"
                )
            shape, places = (lib.n_joints, len(columns)), np.s_[:, columns.index(ROTOR.name)]
            priors.append(FrictionPrior.of_some(shape, places, *prior.armature.T))
        if prior.friction is not None:
            priors.append(prior.friction.of(friction, columns))
    weak = np.array([COLUMNS[c].prior_sigma if c in COLUMNS else np.inf for c in columns])
    if np.isfinite(weak).any():
        sigma = np.tile(weak, (lib.n_joints, 1))
        priors.append(FrictionPrior(np.zeros_like(sigma), sigma))
    return reduce(FrictionPrior.over, priors) if priors else None


def settings_for(lib: Library, settings: fit_settings.Settings) -> fit_settings.Settings:
    """Settings with a method that the robot allows, one without a prior where none was chosen.

    The posterior of "map" draws every parameter to π0 of the URDF; placeholders of a URDF without
    <inertial> would pass for knowledge. The other methods only start there.
    """
    if not lib.placeholders or settings.prior is not None:
        return settings
    if not settings.estimator.takes_prior:
        return settings
    if settings.method is None:
        return replace(settings, method=WITHOUT_PRIOR)
    raise IdentificationError(
        f"the method '{settings.method}' needs an inertial prior, but the URDF of '{lib.name}' "
        f"states no <inertial>; use --method {WITHOUT_PRIOR}, give --prior, or build again with "
        f"the setting masses"
    )
