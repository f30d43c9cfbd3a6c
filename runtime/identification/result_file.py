"""Content of result.json, predictions.npz and posterior.npz from a result; warnings in it."""

import re
from collections.abc import Iterable
from dataclasses import asdict, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.tables import significant
from runtime.errors import IdentificationError
from runtime.estimators.contradictions import FOLLOWS
from runtime.estimators.methods import METHODS
from runtime.estimators.problem import NEGATIVE, NEGATIVE_CAUSE, negative_share
from runtime.estimators.regression.causes import GAIN
from runtime.estimators.regression.factor import compress
from runtime.estimators.regression.samples import samples_of
from runtime.estimators.uncertainty import BAND_SAMPLES
from runtime.identification import metrics, saved_result
from runtime.identification import result_record as schema
from runtime.identification.free_base.result import FreeBaseIdentification
from runtime.identification.identified import Identification, torque_errors
from runtime.library import Array, Library, load, require_library
from runtime.library.manifest import file_units
from runtime.recording import Preparation, Recording
from runtime.recording.formats.npz import arrays_of
from runtime.recording.preprocessing import is_filtered
from runtime.recording.recipes.recipe import COMMANDED
from runtime.recording.rest_speeds import STILL
from runtime.recording.settings import COLUMNS

SUSPICIOUSLY_GOOD = 1e-4  # overall error [%] below which a torque cannot come from a real sensor
WORSE = 1.1  # error of the result over that of the URDF above which the difference is hardly chance
UNEXPLAINED = 20.0
"""Overall error [%] above which the cause is not the method: all real logs that were tried end
below 10 % once units, filter and friction are right."""
RETRACED = 0.8  # share of test rows near a training row above which the test is no new motion
_NEAR = 0.05
"""Largest difference of a position or speed, over its range in training, of rows that count as
equal: controllers repeat a motion within 1 %."""
_TEST_ROWS, _TRAINING_ROWS = 100, 1000  # compared; a joint moves by 1 % of its range between


def retraced(train: Recording, test: Recording) -> float:
    """Share of test rows whose positions and speeds, up to their direction, were in training."""

    def rows(recording: Recording, count: int) -> Array:
        chosen = np.linspace(0, len(recording) - 1, count).round().astype(int)
        chosen = chosen[np.diff(chosen, prepend=-1) > 0]
        state = np.hstack([recording.q[chosen], np.abs(recording.required("dq")[chosen])])
        return np.asarray(state, dtype=float)

    known = rows(train, _TRAINING_ROWS)
    size = np.ptp(known, axis=0)
    moving = size > STILL
    if not moving.any():
        return 0.0
    known, new = (each[:, moving] / size[moving] for each in (known, rows(test, _TEST_ROWS)))
    near = np.ones((len(new), len(known)), dtype=bool)
    for value, others in zip(new.T, known.T, strict=True):
        near &= np.abs(value[:, None] - others) < _NEAR
    return float(np.mean(near.any(axis=1)))


def warnings_of(
    result: Identification,
    before: metrics.TorqueError,
    after: metrics.TorqueError,
    sigma: Array | None = None,
) -> list[str]:
    """Sentences about the limits of a result; sigma (n, k) of `usual_phi`."""
    warnings, history = [*still_joints(result), *result.notes], result.train.history
    # Corrupt rows and warnings of the reading of the log.
    pattern = r"(^|: )(Warning: |(?=Dropped .* as corrupt))"
    warnings += [
        f"{step[: match.start()]}{match[1]}{step[match.end() :].rstrip('.')}"
        for step in history
        if (match := re.search(pattern, step))
    ]
    if result.train.torque_source == COMMANDED:
        warnings.append(
            "the torque is commanded by a control law, not measured: errors are shares of the "
            "commanded torque, and a wrong gain kp scales masses and friction alike"
        )
    warnings += _of_columns(result, sigma)
    if result.train.gains is not None:
        warnings += result.train.gains.sentences()
    if after.overall > max(WORSE * before.overall, SUSPICIOUSLY_GOOD):
        warnings.append(
            f"on the test data this model is worse than the URDF ({significant(before.overall, 3)} "
            f"% became {significant(after.overall, 3)} %): keep the URDF, and record a longer "
            "motion for training"
        )
    if after.overall > UNEXPLAINED:
        # Remedies, the cheapest first.
        filtered = METHODS[result.method].unfiltered or is_filtered(history)
        advice = ["no low-pass was used: --cutoff auto; "] * (not filtered)
        advice += ["no friction was modelled: --friction auto; "] * (not result.phi.size)
        warnings.append(
            f"{significant(after.overall, 3)} % of the test torque is unexplained, too much for a "
            f"useful model; {''.join(advice)}check units, order and signs with: python -m runtime "
            "inspect LOG"
        )
    warnings += _negative(result)
    if not result.has_test:
        warnings.append(
            "all rows were used for the training, so that the errors are those of the training "
            "data; test the model by evaluate with another log"
        )
    elif result.one_run:
        warnings.append(
            "training, validation and test are parts of one run, which underestimates the error; "
            "record a second trajectory for the test"
        )
        share = 0.0 if result.streamed is not None else retraced(result.train, result.test)
        if share > RETRACED:
            warnings.append(
                f"{100 * share:.0f} % of the test rows repeat positions and speeds of the training "
                "rows, as in a motion out and back: the error shows the noise of this motion, not "
                "the error on others"
            )
    if result.test.rows is not None:
        rows = "the power of all joints together" if result.weights.size == 1 else "momenta"
        warnings.append(
            f"the fit uses {rows} and no accelerations; errors are those of the torque after the "
            "same filter"
        )
    if not result.is_consistent:
        warnings.append("some links are not physically consistent; use map for a model to simulate")
    if objective := METHODS[result.method].objective:
        warnings.append(
            f"{result.method} {objective}; its gap is measured in the weighted "
            "loss of the other methods"
        )
    if after.overall < SUSPICIOUSLY_GOOD:
        warnings.append(
            "the fit is exact to rounding: the torque is simulated or the output of a model, not a "
            "measurement"
        )
    if len(result.train) * result.lib.n_joints < 3 * len(result.lib.base_matrix):
        warnings.append("there are fewer than three equations per unknown; record for longer")
    return warnings


def doubts_of(result: Identification, warnings: Iterable[str]) -> list[str]:
    """Reasons not to use a result as it is, the strongest first."""
    known = result.uncertainty
    contradicted = () if known is None else (*known.contradictions, *known.model_errors)
    strong = re.compile(
        r"worse than the URDF|is unexplained|not physically consistent|fewer than|log once"
    )
    stated = [warning for warning in warnings if strong.search(warning)]
    doubts = [*still_joints(result), *contradicted, *stated]
    return sorted(doubts, key=lambda doubt: doubt.endswith(FOLLOWS))


def _of_columns(result: Identification, sigma: Array | None) -> list[str]:
    """Sentences that the records of the friction columns state about their coefficients."""
    names = [name for name in result.friction.columns if name in COLUMNS]
    if not result.phi.size or all(COLUMNS[name].sentences is None for name in names):
        return []
    phi = result.usual_phi
    spread = np.full(phi.shape, np.nan) if sigma is None else sigma
    said: list[str] = []
    for k, name in enumerate(names):
        sentences = COLUMNS[name].sentences
        if sentences is not None:
            said += sentences(result.lib.joint_names, phi[:, k], spread[:, k])
    return said


def _negative(result: Identification) -> list[str]:
    """Negative friction and rotors of a method that does not bound them."""
    columns, tau = result.train.columns, result.train.tau
    if not result.phi.size or columns is None or tau is None:
        return []
    names = result.train.column_names or result.friction.columns
    share = negative_share(columns, tau, result.phi, names)
    wrong = [
        f"{name} of {joint} {result.phi[j, k]:.3g}"
        for j, joint in enumerate(result.lib.joint_names)
        for k, name in enumerate(names)
        if share[j, k] > NEGATIVE
    ]
    if not wrong:
        return []
    return [
        f"negative coefficients that a joint cannot have: {', '.join(wrong)}; {NEGATIVE_CAUSE}; "
        "map and pc-ols bound them by 0"
    ]


def still_joints(result: Identification) -> tuple[str, ...]:
    """Sentence on joints that rest in the training part; none for a log that is not in memory."""
    if result.streamed is not None:
        return ()
    names = np.array(result.lib.joint_names)
    still = names[np.ptp(result.train.q, axis=0) < STILL]
    if not len(still):
        return ()
    if len(still) == len(names):
        return (
            "no joint moves in the training part: the data determine at most the gravity torque "
            "of one pose, and all parameters are those of the URDF; record a motion that moves "
            "every joint",
        )
    return (
        f"{', '.join(still)} never moved in training ({len(still)} of {len(names)} joints): "
        "parameters that only such a motion determines are those of the URDF; record a motion "
        "that moves every joint",
    )


NewResult = Identification | FreeBaseIdentification  # what `runtime.identify` gives
# A path is read by `read_result`.
AnyResult = saved_result.SavedResult | Identification | str | PathLike[str]


def record_of(result: NewResult, command: str) -> schema.ResultRecord:
    """Record of an identification."""
    if isinstance(result, FreeBaseIdentification):
        made = result.record.provenance.replace(command=command)
        return result.record.replace(provenance=made)
    lib, law, trace = result.lib, result.train.law, result.trace
    sigma = result.friction_sigma
    fit, gains, late, drives = result.trained, None, None, None
    if (estimated := result.train.gains) is not None:
        gains = schema.CurrentGain.from_columns(
            channel=estimated.channels,
            gain=estimated.gain,
            sigma=estimated.sigma,
            ratio_to=[estimated.channels[estimated.reference]] * len(estimated.channels),
            ratio_sigma=estimated.ratio_sigma,
            verdict=estimated.verdicts,
        )
    if (drive := result.drive) is not None:
        late = drive.delay_parts()
        drives = drive.parts(lib.joint_names, result.usual_phi, sigma, result.friction.columns)
    errors = torque_errors(result)
    train = compress(lib, samples_of(result.train, lib), np.ones(lib.n_joints))
    warnings = warnings_of(result, errors[0], errors[1], sigma)
    return record_about(
        *(lib, result.pi, result.lam, errors),
        trained=None if fit is None else (fit.pi, replace(result, phi=fit.phi).usual_phi),
        command=command,
        files=dict(result.train.source),
        seed=result.seed,
        method=result.method,
        status=result.status,
        recording=_recording(result),
        torque_source=result.train.torque_source,
        control_law=None if law is None else schema.ControlLaw(law=law.law, **law.numbers),
        current_gains=gains,
        delay_s=late,
        symmetric=result.symmetric or None,
        drive=drives,
        consistent=result.is_consistent,
        gap_to_convex_optimum=schema.plain(result.gap),
        uncertainty=_uncertainty(result),
        loss=result.loss,
        convex_optimum=schema.plain(result.optimum),
        weights=schema.plain(result.weights),
        friction=_friction(result, sigma),
        convergence=None if trace is None else schema.ConvergencePart(**asdict(trace)),
        iterations=result.iterations,
        seconds=result.seconds,
        warnings=tuple(warnings),
        doubts=tuple(doubts_of(result, warnings)),
        condition_number=train.condition(),
        sessions=result.agreement,
    )


def record_about(
    lib: Library,
    pi: Array,
    lam: Array | None,
    errors: Iterable[metrics.TorqueError],
    *,
    trained: tuple[Array, Array] | None,
    command: str,
    files: dict[str, str],
    seed: int | None,
    **facts: Any,
) -> schema.ResultRecord:
    """Record of a robot with its parameters, and the facts that belong to the kind of log.

    `errors` are those of `torque_errors`, `trained` is π and φ of the training part, if others.
    """
    percent, rms = schema.error_parts(*errors)
    return schema.ResultRecord.with_gaps(
        format=schema.FORMAT,
        robot=lib.name,
        base="free" if lib.manifest.floating else "fixed",
        model=saved_result.model_part(lib),
        joints=lib.joint_names,
        units=tuple(file_units(lib.manifest)),
        torque_error_percent=percent,
        torque_rms=rms,
        links=schema.link_parts(lib, pi),
        pi=schema.plain(pi),
        lam=schema.plain(lam),
        beta=schema.plain(lib.base_matrix @ pi),
        trained=None if trained is None else schema.TrainedPart(*map(schema.plain, trained)),
        provenance=schema.ProvenancePart(
            command, lib.versions, files, lib.manifest.model_hash, seed
        ),
        **facts,
    )


def opened(
    result: AnyResult, lib: Library | None, same_bodies: bool = False
) -> tuple[saved_result.SavedResult, Library, tuple[str, ...]]:
    """Result of any kind as `read_result` gives it, its library or the given one, and notes."""
    if isinstance(result, Identification):
        place, lib = f"the result of {result.lib.name}", result.lib if lib is None else lib
        record, fitted = record_of(result, ""), (result.row_marks, result.recipe)
        saved = saved_result.saved_from(record, place, True, *fitted)
    elif isinstance(result, saved_result.SavedResult):
        saved, place = result, f"the result of {result.record.robot}"
    elif isinstance(result, str | PathLike):
        saved, place = saved_result.read_result(result, with_learned=True), str(result)
    else:
        kinds = "a result of runtime.identify or runtime.read_result, or the folder of one"
        raise IdentificationError(f"expected {kinds}, got {result!r:.60}")
    lib = load(saved.record.robot) if lib is None else lib
    require_library(lib)
    return saved, lib, saved_result.require_model(saved.record, lib, place, same_bodies)


def write_result(
    result: NewResult, folder: str | PathLike[str], command: str = "runtime.identify"
) -> schema.ResultRecord:
    """Write result.json, predictions.npz and posterior.npz, which all commands read.

    Args:
        result: of `runtime.identify`.
        folder: of the files, created where it is missing; those of an earlier result are replaced.
        command: how the result was made, for its provenance.

    Returns:
        The content of result.json.

    Raises:
        RuntimeFault: no result, parameters that no reader accepts, or a folder without access.
    """
    if not isinstance(result, NewResult):
        raise IdentificationError(
            f"expected a result of runtime.identify, got {result!r:.60}; the files of one that was "
            "read are in its folder"
        )
    if not isinstance(folder, str | PathLike):
        raise IdentificationError(f"expected the folder of a result, got {folder!r:.60}")
    files = files_of(result, command)
    files.write(Path(folder))
    return files.record


def files_of(result: NewResult, command: str) -> saved_result.ResultFiles:
    """Content of the files of a result."""
    largest = float(np.abs([*result.pi, *np.ravel(result.usual_phi)]).max())
    if not largest < saved_result.LARGEST_VALUE:  # which no reader would accept
        raise IdentificationError(
            f"expected parameters and friction coefficients below {saved_result.LARGEST_VALUE:g} "
            f"in SI units, got {largest:.3g}, so nothing was written; leave out friction columns "
            "that the motion does not excite, or use a method with a prior (map)"
        )
    record, posterior = record_of(result, command), result.posterior
    arrays = None if posterior is None else arrays_of(posterior)
    return saved_result.ResultFiles(record, result.predictions, arrays)


def _recording(result: Identification) -> schema.RecordingPart:
    logs = {"train": result.train, "validation": result.validation, "test": result.test}
    whole = result.streamed
    samples = {name: len(log) for name, log in logs.items()} if whole is None else whole.samples
    ends = {
        name: (float(log.t[0]), float(log.t[-1])) if whole is None else whole.spans[name]
        for name, log in logs.items()
        if name == "train" or (result.has_test and not (name == "validation" and result.is_joined))
    }
    return schema.RecordingPart(
        name=result.train.name.removesuffix("/train"),
        duration=float(sum(b - a for a, b in ends.values())),
        samples={name: samples[name] if name in ends else 0 for name in logs},
        history=tuple(result.train.history),
        preparation=stated_steps(result.preparation),
        split=", ".join(f"{name} {a:.2f}–{b:.2f} s" for name, (a, b) in ends.items()),
    )


def stated_steps(preparation: Preparation) -> dict[str, Any]:
    """Settings of a preparation that are not the default."""
    usual, steps = Preparation(), asdict(preparation)
    return {key: value for key, value in steps.items() if value != getattr(usual, key)}


def _uncertainty(result: Identification) -> schema.UncertaintyPart | None:
    """The posterior without its covariance, which stays with the `Identification`."""
    u, lib = result.uncertainty, result.lib
    if u is None:
        return None
    test = samples_of(result.test, lib)
    band = u.band_of(lib, test.rows(slice(None, None, max(1, len(test) // BAND_SAMPLES))))
    return schema.uncertainty_part(
        *(lib, result.pi, u.root, u.share, u.verdicts),
        advice=u.advice(),
        n_eff=u.n_eff,
        inflation=u.inflation,
        excited=u.rank,
        weakest_direction=u.conditioning,
        beta_verdicts=tuple(u.beta_verdicts),
        noise=schema.plain(u.noise),
        model_band=schema.plain(np.sqrt(np.mean(band**2, axis=0))),
        white_lag_share=schema.plain(u.white),
        detectable_gain_error=schema.plain(u.tests.causes.limits(GAIN)),
        gain_sigma=u.gain_sigma,
    )


def _friction(result: Identification, sigma: Array | None) -> schema.FrictionPart | None:
    """Columns, coefficients and intervals; None where none was fitted."""
    terms, motors, phi = result.friction, result.train.motors, result.usual_phi
    names = () if result.log_names else result.train.column_names
    return schema.friction_part(
        *(terms, phi, sigma),
        columns=tuple(names or terms.columns),
        gear=terms.gear if motors is None else schema.plain(motors),
        net=None if result.learned is None else result.learned.facts(),
    )
