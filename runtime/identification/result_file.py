"""Writer of result.json, predictions.npz and posterior.npz: each is written whole or not at all."""

import json
import sys
from dataclasses import asdict, replace
from importlib import import_module
from os import PathLike
from pathlib import Path

import msgspec
import numpy as np

from runtime.common.files import replacing
from runtime.errors import IdentificationError
from runtime.estimators.classical.pc_ols import BOUNDARY
from runtime.estimators.regression.compression import compress
from runtime.estimators.regression.samples import samples_of
from runtime.estimators.uncertainty import BAND_SAMPLES
from runtime.identification import result_record as schema
from runtime.identification.identified import Identification, friction_error, torque_errors
from runtime.identification.model_identity import model_part, require_model
from runtime.identification.posterior_file import (
    friction_intervals,
    friction_sigma,
    posterior_of_result,
    write_posterior,
)
from runtime.identification.predictions_file import of_further_logs, write_predictions
from runtime.identification.result_warnings import doubts_of, warnings_of
from runtime.identification.saved_result import (
    LARGEST_VALUE,
    SavedResult,
    read_result,
    saved_from,
)
from runtime.library import Array, Library, load, require_library
from runtime.library.manifest import file_units
from runtime.recording import Preparation
from runtime.recording.recipes.recipe import NUMBERS

__all__ = ["versions"]

AnyResult = SavedResult | Identification | str | PathLike[str]
"""What functions on results take; a path is read by `read_result`."""
GAINS = tuple[schema.CurrentGain, ...]


def record_of(result: Identification, command: str) -> schema.ResultRecord:
    """Record of an identification."""
    lib, drive, gains = result.lib, result.drive, result.train.gains
    trace, fit = result.trace, result.trained
    before, after = torque_errors(result)
    train = compress(lib, samples_of(result.train, lib), np.ones(lib.n_joints))
    warnings = warnings_of(result, before, after)
    percent, rms = schema.error_parts(before, after, friction_error(result))
    columns = result.friction.columns
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
        control_law=_law(result),
        current_gains=None if gains is None else msgspec.convert(gains.facts(), GAINS),
        delay_s=None if drive is None else drive.delay_parts(),
        symmetric=result.symmetric or None,
        drive=None
        if drive is None
        else drive.parts(lib.joint_names, result.usual_phi, friction_sigma(result), columns),
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
        lam=None if result.lam is None else schema.plain(result.lam),
        beta=schema.plain(result.beta),
        condition_number=train.condition(),
        trained=None
        if fit is None
        else schema.TrainedPart(
            pi=schema.plain(fit.pi),
            friction_values=schema.plain(replace(result, phi=fit.phi).usual_phi),
        ),
        sessions=result.agreement,
        provenance=schema.ProvenancePart(
            command=command,
            versions=versions() | lib.manifest.versions,
            files=dict(result.train.source),
            model_hash=lib.manifest.model_hash,
            seed=result.seed,
        ),
    )


def opened(
    result: AnyResult, lib: Library | None, same_bodies: bool = False
) -> tuple[SavedResult, Library, tuple[str, ...]]:
    """Result of any kind as `read_result` gives it, its library or the given one, and notes."""
    if isinstance(result, Identification):
        place = f"the result of {result.lib.name}"
        fitted = result.row_marks, of_further_logs(result)
        saved = saved_from(record_of(result, ""), place, fitted, with_learned=True)
        lib = result.lib if lib is None else lib
    elif isinstance(result, str | PathLike):
        saved, place = read_result(result, with_learned=True), str(result)
    elif isinstance(result, SavedResult):
        saved, place = result, f"the result of {result.record.robot}"
    else:
        raise IdentificationError(
            "expected a result of runtime.identify or runtime.read_result, or the folder of one, "
            f"got {result!r:.60}"
        )
    lib = load(saved.record.robot) if lib is None else lib
    require_library(lib)
    return saved, lib, require_model(saved.record, lib, place, same_bodies)


def write_record(record: schema.ResultRecord, folder: Path) -> None:
    """Write result.json into a folder, as a whole or not at all."""
    facts = msgspec.to_builtins(record)
    text = json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    with replacing(folder / "result.json") as file:
        file.write(text.encode())


def write_result(result: Identification, folder: Path, command: str) -> schema.ResultRecord:
    """Write result.json, predictions.npz and, with an uncertainty, posterior.npz into a folder."""
    require_size(np.concatenate([result.pi, np.ravel(result.usual_phi)]))
    record = record_of(result, command)
    if (posterior := posterior_of_result(result)) is not None:
        write_posterior(folder, posterior)
    write_predictions(result, folder / "predictions.npz")
    write_record(record, folder)
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


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries that compute a result."""
    python = ".".join(map(str, sys.version_info[:3]))
    return {"python": python} | {
        name: str(import_module(name).__version__) for name in ("numpy", "scipy", "clarabel")
    }


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
    step = max(1, len(test) // BAND_SAMPLES)
    band = u.band_of(lib, test.rows(slice(None, None, step)))
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
        detectable_gain_error=schema.plain(u.tests.gain_limits),
        gain_sigma=u.gain_sigma,
    )


def _friction(result: Identification) -> schema.FrictionPart | None:
    """Columns, coefficients and intervals; None where none was fitted."""
    if not result.phi.size:
        return None
    names, terms, motors = result.friction.columns, result.friction, result.train.motors
    if not result.log_names:
        names = result.train.column_names or names
    sigma, interval = friction_intervals(result)
    return schema.FrictionPart(
        columns=tuple(names),
        values=schema.plain(result.usual_phi),
        coulomb_speed=terms.coulomb_speed,
        stribeck_speed=terms.stribeck_speed,
        dahl_stroke=terms.dahl_stroke,
        gear=terms.gear if motors is None else schema.plain(motors),
        sigma=sigma,
        interval_95=interval,
        net=None if result.learned is None else result.learned.facts(),
    )


def _law(result: Identification) -> schema.ControlLaw | None:
    """Numbers of the control law; a gain that varies over the log has none."""
    law = result.train.law
    if law is None:
        return None
    known = {key: None if isinstance(x := getattr(law, key), str) else x for key in NUMBERS}
    return schema.ControlLaw(law=law.law, **known)
