"""Writer of result.json, predictions.npz and posterior.npz: each is written whole or not at all."""

from dataclasses import asdict, replace
from os import PathLike
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from runtime.common.files import write_json
from runtime.errors import IdentificationError
from runtime.estimators.classical.pc_ols import BOUNDARY
from runtime.estimators.regression.causes import GAIN
from runtime.estimators.regression.compression import compress
from runtime.estimators.regression.samples import samples_of
from runtime.estimators.uncertainty import BAND_SAMPLES
from runtime.identification import posterior_file, predictions_file
from runtime.identification import result_record as schema
from runtime.identification.identified import Identification, friction_error, torque_errors
from runtime.identification.model_identity import model_part, require_model
from runtime.identification.result_warnings import doubts_of, warnings_of
from runtime.identification.saved_result import LARGEST_VALUE, SavedResult, read_result, saved_from
from runtime.library import Array, Library, load, require_library
from runtime.library.manifest import file_units
from runtime.recording import Preparation
from runtime.recording.settings import WIDTHS

AnyResult = SavedResult | Identification | str | PathLike[str]
"""What functions on results take; a path is read by `read_result`."""


def record_of(result: Identification, command: str) -> schema.ResultRecord:
    """Record of an identification."""
    lib, law, trace = result.lib, result.train.law, result.trace
    gains = late = drives = trained = None
    if (estimated := result.train.gains) is not None:
        gains = tuple(schema.CurrentGain(**each) for each in estimated.facts())
    if (drive := result.drive) is not None:
        late, sigma = drive.delay_parts(), posterior_file.friction_sigma(result)
        drives = drive.parts(lib.joint_names, result.usual_phi, sigma, result.friction.columns)
    if (fit := result.trained) is not None:
        values = schema.plain(replace(result, phi=fit.phi).usual_phi)
        trained = schema.TrainedPart(pi=schema.plain(fit.pi), friction_values=values)
    before, after = torque_errors(result)
    train = compress(lib, samples_of(result.train, lib), np.ones(lib.n_joints))
    warnings = warnings_of(result, before, after)
    percent, rms = schema.error_parts(before, after, friction_error(result))
    return schema.ResultRecord(
        format=schema.FORMAT,
        method=result.method,
        robot=lib.name,
        base="fixed",
        model=model_part(lib),
        status=result.status,
        joints=lib.joint_names,
        units=tuple(file_units(lib.manifest)),
        recording=_recording(result),
        torque_source=result.train.torque_source,
        control_law=None if law is None else schema.ControlLaw(law=law.law, **law.numbers),
        current_gains=gains,
        delay_s=late,
        symmetric=result.symmetric or None,
        drive=drives,
        torque_error_percent=percent,
        torque_rms=rms,
        links=schema.link_parts(lib, result.pi, result.relative_eigenvalues),
        consistent=result.is_consistent,
        gap_to_convex_optimum=schema.plain(result.gap),
        uncertainty=_uncertainty(result),
        loss=result.loss,
        convex_optimum=schema.plain(result.optimum),
        weights=schema.plain(result.weights),
        friction=_friction(result),
        convergence=None if trace is None else schema.ConvergencePart(**asdict(trace)),
        iterations=result.iterations,
        seconds=result.seconds,
        warnings=tuple(warnings),
        doubts=tuple(doubts_of(result, warnings)),
        pi=schema.plain(result.pi),
        lam=schema.plain(result.lam),
        beta=schema.plain(result.beta),
        condition_number=train.condition(),
        trained=trained,
        sessions=result.agreement,
        provenance=provenance_of(lib, command, dict(result.train.source), result.seed),
    )


def opened(
    result: AnyResult, lib: Library | None, same_bodies: bool = False
) -> tuple[SavedResult, Library, tuple[str, ...]]:
    """Result of any kind as `read_result` gives it, its library or the given one, and notes."""
    if isinstance(result, Identification):
        place, lib = f"the result of {result.lib.name}", result.lib if lib is None else lib
        record, recipe = record_of(result, ""), predictions_file.of_further_logs(result)
        saved = saved_from(record, place, True, result.row_marks, recipe)
    elif isinstance(result, SavedResult):
        saved, place = result, f"the result of {result.record.robot}"
    elif isinstance(result, str | PathLike):
        saved, place = read_result(result, with_learned=True), str(result)
    else:
        kinds = "a result of runtime.identify or runtime.read_result, or the folder of one"
        raise IdentificationError(f"expected {kinds}, got {result!r:.60}")
    lib = load(saved.record.robot) if lib is None else lib
    require_library(lib)
    return saved, lib, require_model(saved.record, lib, place, same_bodies)


def write_result(result: Identification, folder: Path, command: str) -> schema.ResultRecord:
    """Write the files of an identification into a folder."""
    require_size(np.concatenate([result.pi, np.ravel(result.usual_phi)]))
    record, rows = record_of(result, command), predictions_file.predictions_of(result)
    return write_files(record, folder, posterior_file.posterior_of_result(result), rows)


def write_files(
    record: schema.ResultRecord,
    folder: Path,
    posterior: posterior_file.SavedPosterior | None,
    rows: dict[str, Any],
) -> schema.ResultRecord:
    """Write posterior.npz where there is one, predictions.npz and result.json into a folder."""
    if posterior is not None:
        posterior_file.write_posterior(folder, posterior)
    predictions_file.write_predictions(folder, rows)
    write_json(folder / "result.json", msgspec.to_builtins(record))
    return record


def require_size(values: Array) -> None:
    """Refuse parameters that no reader would accept."""
    largest = float(np.abs(values).max())
    if not largest < LARGEST_VALUE:
        raise IdentificationError(
            f"expected parameters and friction coefficients below {LARGEST_VALUE:g} in SI units, "
            f"got {largest:.3g}, so nothing was written; leave out friction columns that the "
            "motion does not excite, or use a method with a prior (map)"
        )


def provenance_of(
    lib: Library, command: str, files: dict[str, str], seed: int | None
) -> schema.ProvenancePart:
    """How to compute a result again, with the versions of what computed it."""
    model, used = lib.manifest.model_hash, lib.versions
    return schema.ProvenancePart(
        command=command, versions=used, files=files, model_hash=model, seed=seed
    )


def _recording(result: Identification) -> schema.RecordingPart:
    """Name, duration, rows, preparation and split of the log."""
    logs = {"train": result.train, "validation": result.validation, "test": result.test}
    whole = result.streamed
    samples = {name: len(log) for name, log in logs.items()} if whole is None else whole.samples
    ends = {
        name: (float(log.t[0]), float(log.t[-1])) if whole is None else whole.spans[name]
        for name, log in logs.items()
        if name == "train" or (result.has_test and not (name == "validation" and result.is_joined))
    }
    usual, steps = Preparation(), asdict(result.train.prepared or Preparation())
    return schema.RecordingPart(
        name=result.train.name.removesuffix("/train"),
        duration=float(sum(b - a for a, b in ends.values())),
        samples={name: samples[name] if name in ends else 0 for name in logs},
        history=tuple(result.train.history),
        preparation={key: value for key, value in steps.items() if value != getattr(usual, key)},
        split=", ".join(f"{name} {a:.2f}–{b:.2f} s" for name, (a, b) in ends.items()),
    )


def _uncertainty(result: Identification) -> schema.UncertaintyPart | None:
    """The posterior without its covariance, which stays with the `Identification`."""
    u, lib = result.uncertainty, result.lib
    if u is None:
        return None
    test = samples_of(result.test, lib)
    band = u.band_of(lib, test.rows(slice(None, None, max(1, len(test) // BAND_SAMPLES))))
    return schema.UncertaintyPart(
        advice=u.advice(),
        n_eff=u.n_eff,
        inflation=u.inflation,
        excited=u.rank,
        weakest_direction=u.conditioning,
        boundary=bool(np.abs(result.relative_eigenvalues).min() < BOUNDARY),
        links=schema.link_uncertainties(u.sigma, u.com_sigma(result.pi), u.verdicts),
        pi_sigma=schema.plain(u.sigma),
        posterior_over_prior=schema.plain(u.share),
        beta_sigma=schema.plain(u.beta_sigma),
        beta_verdicts=tuple(u.beta_verdicts),
        noise=schema.plain(u.noise),
        model_band=schema.plain(np.sqrt(np.mean(band**2, axis=0))),
        white_lag_share=schema.plain(u.white),
        detectable_gain_error=schema.plain(u.tests.causes.limits(GAIN)),
        gain_sigma=u.gain_sigma,
    )


def _friction(result: Identification) -> schema.FrictionPart | None:
    """Columns, coefficients and intervals; None where none was fitted."""
    if not result.phi.size:
        return None
    terms, motors = result.friction, result.train.motors
    names = () if result.log_names else result.train.column_names
    sigma, interval = posterior_file.friction_intervals(result)
    return schema.FrictionPart(
        columns=tuple(names or terms.columns),
        values=schema.plain(result.usual_phi),
        **{key: getattr(terms, key) for key in WIDTHS},
        gear=terms.gear if motors is None else schema.plain(motors),
        sigma=sigma,
        interval_95=interval,
        net=None if result.learned is None else result.learned.facts(),
    )
