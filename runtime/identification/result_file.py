"""Writer of result.json, predictions.npz and posterior.npz: each is written whole or not at all."""

import dataclasses
import json
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import replacing
from runtime.errors import IdentificationError
from runtime.estimators.classical.pc_ols import BOUNDARY
from runtime.estimators.regression import compress
from runtime.estimators.regression.samples import samples_of
from runtime.estimators.uncertainty import BAND_SAMPLES
from runtime.identification import metrics
from runtime.identification.friction_intervals import interval_facts
from runtime.identification.identified import Identification, friction_error, torque_errors
from runtime.identification.posterior_file import write_posterior
from runtime.identification.result_schema import FORMAT
from runtime.identification.result_warnings import warnings_of
from runtime.identification.saved_result import LARGEST_VALUE, model_facts
from runtime.library import Array
from runtime.library.manifest import file_units
from runtime.library.parameters import N_PARAMETERS, centre_of_mass, links, mass
from runtime.recording import Preparation
from runtime.recording.recipes.recipe import NUMBERS

__all__ = [
    "error_facts",
    "versions",
    "write_result",
]


def result_facts(result: Identification, command: str) -> dict[str, Any]:
    """Facts of result.json."""
    lib = result.lib
    before, after = torque_errors(result)
    return {
        "format": FORMAT,
        "method": result.method,
        "robot": lib.name,
        "model": model_facts(lib),
        "status": result.status,
        "joints": list(lib.joint_names),
        "units": file_units(lib.manifest),
        "recording": recording_facts(result),
        **torque_facts(result),
        **error_facts(before, after, friction_error(result)),
        "links": link_facts(result),
        "consistent": result.is_consistent,
        "gap_to_convex_optimum": result.gap if np.isfinite(result.gap) else None,
        "uncertainty": uncertainty_facts(result),
        "loss": result.loss,
        "convex_optimum": result.optimum if np.isfinite(result.optimum) else None,
        "weights": result.weights.tolist(),
        "friction": friction_facts(result),
        "convergence": trace_facts(result),
        "iterations": result.iterations,
        "seconds": result.seconds,
        "warnings": warnings_of(result, before, after),
        "pi": result.pi.tolist(),
        "lam": None if result.lam is None else result.lam.tolist(),
        "beta": result.beta.tolist(),
        "condition_number": condition_number(result),
        "trained": trained_facts(result),
        "sessions": None if result.agreement is None else result.agreement.facts(),
        "provenance": {
            "command": command,
            "versions": versions() | lib.manifest.versions,
            "files": dict(result.train.source),
            "model_hash": lib.manifest.model_hash,
            "seed": result.seed,
        },
    }


def error_facts(
    before: metrics.TorqueError,
    after: metrics.TorqueError,
    with_friction: metrics.TorqueError | None = None,
) -> dict[str, Any]:
    """Torque errors of two models on the same samples, JSON-ready.

    Args:
        before: errors of the first model.
        after: errors of the second model.
        with_friction: errors of the first model with fitted friction.

    Returns:
        Errors per joint and overall [%], RMS per joint [N·m, N]; null where they are not finite.
    """

    def percent(values: Array) -> list[float | None]:
        return [float(x) if np.isfinite(x) else None for x in values]

    facts: dict[str, Any] = {
        "torque_error_percent": {
            "before": percent(before.percent),
            "after": percent(after.percent),
            "before_overall": before.overall,
            "after_overall": after.overall,
        },
        "torque_rms": {"before": before.rms.tolist(), "after": after.rms.tolist()},
    }
    if with_friction is not None:
        facts["torque_error_percent"] |= {
            "urdf_friction": percent(with_friction.percent),
            "urdf_friction_overall": with_friction.overall,
        }
        facts["torque_rms"]["urdf_friction"] = with_friction.rms.tolist()
    return facts


def write_result(result: Identification, folder: Path, command: str) -> dict[str, Any]:
    """Write result.json, predictions.npz and, with an uncertainty, posterior.npz into a folder.

    Args:
        result: result of an identification.
        folder: existing folder.
        command: command line that made the result.

    Returns:
        Content of result.json.

    Raises:
        IdentificationError: parameters are too large to be written.
    """
    largest = float(np.abs(np.concatenate([result.pi, np.ravel(result.usual_phi)])).max())
    if not largest < LARGEST_VALUE:
        raise IdentificationError(
            f"expected parameters and friction coefficients below {LARGEST_VALUE:g} in SI units, "
            f"got {largest:.3g}, so nothing was written; leave out friction columns that the "
            "motion does not excite, or use a method with a prior (map)"
        )
    facts = result_facts(result, command)
    test = samples_of(result.test, result.lib)
    arrays = {
        "t": np.asarray(result.test.t),
        "dq": test.dq,
        "measured": test.tau,
        "before": result.before(result.test),
        "after": result.predict_test(),
    }
    text = json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    if result.uncertainty is not None:
        write_posterior(folder, result.uncertainty, result.pi, len(result.log_names))
    with replacing(folder / "predictions.npz") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]  # noise does not compress
    with replacing(folder / "result.json") as file:
        file.write(text.encode())
    return facts


def condition_number(result: Identification) -> float | None:
    """Condition number of the column-normalised [Y_b F] of the training samples.

    None where the matrix is singular.
    """
    lib, train = result.lib, samples_of(result.train, result.lib)
    statistics = compress(lib, train, np.ones(lib.n_joints))
    matrix, _ = statistics.unit_columns()
    # Rotors and motors that count into links are not separate unknowns.
    kept = np.concatenate([np.ones(statistics.n_base, dtype=bool), ~statistics.explained()])
    sigma = np.linalg.svd(matrix[:, kept], compute_uv=False)
    return float(sigma[0] / sigma[-1]) if sigma[-1] > 1e-14 * sigma[0] else None


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries that compute a result."""
    python = ".".join(map(str, sys.version_info[:3]))
    return {"python": python} | {
        name: str(import_module(name).__version__) for name in ("numpy", "scipy", "clarabel")
    }


def recording_facts(result: Identification) -> dict[str, Any]:
    """Part `recording`: name, duration, rows, preparation and split of the log."""
    parts: Mapping[str, Any] = {
        "train": result.train,
        "validation": result.validation,
        "test": result.test,
    }
    ends = {name: (float(r.t[0]), float(r.t[-1])) for name, r in parts.items()}
    samples = {name: len(r) for name, r in parts.items()}
    if result.streamed is not None:
        ends, samples = result.streamed.spans, result.streamed.samples
    counted = [
        name
        for name in parts
        if name == "train" or (result.has_test and not (name == "validation" and result.is_joined))
    ]
    ends = {name: ends[name] for name in counted}
    samples = {name: samples[name] if name in counted else 0 for name in parts}
    spans = ", ".join(f"{name} {a:.2f}–{b:.2f} s" for name, (a, b) in ends.items())
    return {
        "name": result.train.name.removesuffix("/train"),
        "duration": float(sum(b - a for a, b in ends.values())),
        "samples": samples,
        "history": list(result.train.history),
        "preparation": _changed(result.train.prepared),
        "split": spans,
    }


def _changed(preparation: Preparation | None) -> dict[str, Any]:
    """Settings of a preparation that are not the default."""
    usual = Preparation()
    facts = dataclasses.asdict(preparation or usual)
    return {key: value for key, value in facts.items() if value != getattr(usual, key)}


def link_facts(result: Identification) -> list[dict[str, Any]]:
    """Part `links`: masses and centres of mass before and after, and consistency."""
    smallest = result.relative_eigenvalues
    rows = zip(
        result.lib.link_names, links(result.pi), links(result.lib.pi0), smallest, strict=True
    )
    return [
        {
            "name": name,
            "mass": float(mass(now)),
            "mass_before": float(mass(then)),
            "com": centre_of_mass(now).tolist(),
            "com_before": centre_of_mass(then).tolist(),
            "min_relative_eigenvalue": float(eigenvalue),
        }
        for name, now, then, eigenvalue in rows
    ]


def uncertainty_facts(result: Identification) -> dict[str, Any] | None:
    """Part `uncertainty`; the covariance itself stays with the `Identification`."""
    u, lib = result.uncertainty, result.lib
    if u is None:
        return None
    test = samples_of(result.test, lib)
    step = max(1, len(test) // BAND_SAMPLES)
    band = u.band_of(lib, test.rows(slice(None, None, step)))
    size = N_PARAMETERS
    sigma, spreads = u.sigma, u.com_sigma(result.pi)
    verdicts = [u.verdicts[k * size : (k + 1) * size] for k in range(lib.n_links)]
    return {
        "advice": u.advice(),
        "n_eff": u.n_eff,
        "inflation": u.inflation,
        "excited": u.rank,
        "weakest_direction": u.conditioning,
        "boundary": bool(np.abs(result.relative_eigenvalues).min() < BOUNDARY),
        "links": [
            {
                "mass_sigma": float(sigma[k * size]),
                "com_sigma": None if s is None else s.tolist(),
                "verdicts": list(v),
            }
            for k, (s, v) in enumerate(zip(spreads, verdicts, strict=True))
        ],
        "pi_sigma": u.sigma.tolist(),
        "posterior_over_prior": u.share.tolist(),
        "beta_sigma": u.beta_sigma.tolist(),
        "beta_verdicts": list(u.beta_verdicts),
        "noise": u.noise.tolist(),
        "model_band": np.sqrt(np.mean(band**2, axis=0)).tolist(),
        "white": u.white.tolist(),
        "gain_limits": [float(x) if np.isfinite(x) else None for x in u.tests.gain_limits],
    }


def friction_facts(result: Identification) -> dict[str, Any] | None:
    """Part `friction`: columns, coefficients and intervals; None where none was fitted."""
    if not result.phi.size:
        return None
    names = result.friction.columns
    if not result.log_names:
        names = result.train.column_names or names
    motors = result.train.motors
    return {
        **result.friction.facts(),
        "columns": list(names),
        "values": result.usual_phi.tolist(),
        **interval_facts(result),
        **({} if motors is None else {"gear": motors.tolist()}),
        **({} if result.learned is None else {"net": result.learned.facts()}),
    }


def trained_facts(result: Identification) -> dict[str, Any] | None:
    """Part `trained`: parameters of the training rows; None where they are those of the result."""
    if result.trained is None:
        return None
    phi = dataclasses.replace(result, phi=result.trained.phi).usual_phi
    return {"pi": result.trained.pi.tolist(), "friction_values": phi.tolist()}


def trace_facts(result: Identification) -> dict[str, Any] | None:
    """Part `convergence`: losses by iteration; None for methods without iterations."""
    if result.trace is None:
        return None
    return {
        "iteration": list(result.trace.iteration),
        "training": list(result.trace.training),
        "validation": list(result.trace.validation),
    }


def torque_facts(result: Identification) -> dict[str, Any]:
    """Keys of result.json on the torque: source, control law, gains, delay and drives."""
    drive, joints = result.drive, result.lib.joint_names
    columns = result.friction.columns
    return {
        "torque_source": result.train.torque_source,
        "control_law": _law_facts(result),
        "current_gains": None if result.train.gains is None else result.train.gains.facts(),
        "delay_s": None if drive is None else drive.delay_facts(),
        "symmetric": [each.facts() for each in result.symmetric] or None,
        "drive": None if drive is None else drive.facts(joints, result.phi, columns),
    }


def _law_facts(result: Identification) -> dict[str, Any] | None:
    """Numbers of the control law; a gain that varies over the log has none."""
    law = result.train.law
    if law is None:
        return None
    numbers = {key: getattr(law, key) for key in NUMBERS}
    known = {key: None if isinstance(each, str) else each for key, each in numbers.items()}
    return {"law": law.law} | {
        key: list(each) if isinstance(each, tuple) else each for key, each in known.items()
    }
