"""Writer of result.json, predictions.npz and posterior.npz: each is written whole or not at all."""

import json
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.regression import compress
from runtime.estimators.regression.samples import samples_of
from runtime.files import replacing
from runtime.identification import metrics
from runtime.identification.drive.result_facts import torque_facts
from runtime.identification.identified import Identification, friction_error, torque_errors
from runtime.identification.posterior_file import write_posterior
from runtime.identification.result_parts import (
    friction_facts,
    link_facts,
    recording_facts,
    trace_facts,
    trained_facts,
    uncertainty_facts,
)
from runtime.identification.result_schema import FORMAT
from runtime.identification.result_warnings import warnings_of
from runtime.identification.saved_result import LARGEST, model_facts
from runtime.library import Array
from runtime.library.torque_units import file_units


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
        "sessions": None,
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
    """Torque errors of two models on the same samples, JSON-ready."""

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


def write_result(
    result: Identification, folder: Path, command: str, agreement: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Write result.json, predictions.npz and, with an uncertainty, posterior.npz into a folder."""
    largest = float(np.abs(np.concatenate([result.pi, np.ravel(result.usual_phi)])).max())
    if not largest < LARGEST:
        raise IdentificationError(
            f"expected parameters and friction coefficients below {LARGEST:g} in SI units, got "
            f"{largest:.3g}, so nothing was written; leave out friction columns that the motion "
            "does not excite, or use a method with a prior (map)"
        )
    facts = result_facts(result, command) | {"sessions": agreement}
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
