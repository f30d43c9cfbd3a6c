"""`result.json` and `predictions.npz` of a result folder → frozen `Result`, checked once.

Other modules of the report rely on its shapes and types; optional parts are None or empty.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from runtime.common.files import require_file, values_of
from runtime.errors import RecordingError, RuntimeFault
from runtime.identification.result_schema import read_facts
from runtime.outputs.report.several_logs import SeveralLogs, read_several_logs
from runtime.outputs.report.sides import SideRow, read_sides
from runtime.outputs.report.uncertainty import ResultUncertainty, read_uncertainty
from runtime.recording.formats.npz import open_npz

Array = NDArray[np.float64]

LARGEST_ACCEPTED = 1e100
"""Largest number that is accepted, in SI units; matplotlib cannot draw much larger ones."""
_AGAIN = "identify again, or give the output folder of an identification"


@dataclass(frozen=True, slots=True)
class Errors:
    """Torque errors of one model: (n,) per joint [%], over all joints [%], (n,) RMS [N·m, N]."""

    percent: Array
    overall: float
    rms: Array


@dataclass(frozen=True, slots=True)
class Link:
    """One link before (URDF) and after: masses [kg], centres of mass (3,) [m], λ_min(P)/tr P."""

    name: str
    mass_before: float
    mass: float
    com_before: Array
    com: Array
    eigenvalue: float


@dataclass(frozen=True, slots=True)
class IdentifiedFriction:
    """Friction columns, width of the smooth sign [rad/s, m/s] and (n, k) coefficients."""

    columns: tuple[str, ...]
    coulomb_speed: float
    values: Array


@dataclass(frozen=True, slots=True)
class Convergence:
    """Loss over iterations; NaN where it was not evaluated."""

    iteration: Array
    training: Array
    validation: Array


@dataclass(frozen=True, slots=True)
class PredictedTorques:
    """Torques over the test split: t (N,) [s] and measured, before, after (N, n)."""

    t: Array
    measured: Array
    before: Array
    after: Array


@dataclass(frozen=True, slots=True)
class RecordingSummary:
    """Name, duration [s], numbers of samples and preparation of the recording."""

    name: str
    duration: float | None
    samples: Mapping[str, int]
    history: tuple[str, ...]
    split: str


@dataclass(frozen=True, slots=True)
class Provenance:
    """Command, versions, files and seed that reproduce the result."""

    command: str
    versions: Mapping[str, str]
    files: Mapping[str, str]
    model_hash: str
    seed: int | None


@dataclass(frozen=True, slots=True)
class Result:
    """Content of the result folder of one identification.

    `with_friction` is the overall error of the URDF with fitted friction [%].
    """

    robot: str
    method: str
    status: str
    joints: tuple[str, ...]
    units: tuple[str, ...]
    recording: RecordingSummary
    before: Errors
    after: Errors
    with_friction: float | None
    links: tuple[Link, ...]
    consistent: bool
    gap: float | None
    weights: Array
    friction: IdentifiedFriction | None
    convergence: Convergence | None
    iterations: int | None
    seconds: float | None
    condition_number: float | None
    warnings: tuple[str, ...]
    uncertainty: ResultUncertainty | None
    several_logs: SeveralLogs | None
    sides: tuple[SideRow, ...]
    provenance: Provenance
    prediction: PredictedTorques


def read_result(folder: Path) -> Result:
    """Read a result folder."""
    path = folder / "result.json"
    try:
        raw = read_facts(path)
    except OSError as error:
        raise RuntimeFault(f"cannot read '{path}' ({error.strerror or error}); {_AGAIN}") from None
    except KeyError as error:
        raise RuntimeFault(f"'{path}' is damaged (no valid {error}); {_AGAIN}") from None
    except (ValueError, TypeError) as error:
        raise RuntimeFault(f"'{path}' is damaged ({error}); {_AGAIN}") from None
    if any(isinstance(x, float) and LARGEST_ACCEPTED < abs(x) < np.inf for x in values_of(raw)):
        raise RuntimeFault(f"'{path}' is damaged (a number above {LARGEST_ACCEPTED:g}); {_AGAIN}")
    try:
        return _result(raw, folder)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise RuntimeFault(f"'{path}' is damaged (no valid {error}); {_AGAIN}") from None


def _result(raw: Mapping[str, Any], folder: Path) -> Result:
    joints = _texts(raw, "joints")
    n = len(joints)
    units = _texts(raw, "units") or ("",) * n
    if len(units) != n:
        raise ValueError(f"'units': expected {n}, one per joint, got {len(units)}")
    percent, rms = raw["torque_error_percent"], raw["torque_rms"]
    return Result(
        robot=str(raw["robot"]),
        method=str(raw["method"]),
        status=str(raw["status"] or ""),
        joints=joints,
        units=units,
        recording=_recording(raw["recording"] or {}),
        before=_errors(percent, rms, "before", n),
        after=_errors(percent, rms, "after", n),
        with_friction=_optional(percent, "urdf_friction_overall"),
        links=tuple(_link(link) for link in raw["links"]),
        consistent=bool(raw["consistent"]),
        gap=_optional(raw, "gap_to_convex_optimum"),
        weights=np.array(raw["weights"], dtype=float),
        friction=_friction(raw["friction"], n),
        convergence=_convergence(raw["convergence"]),
        iterations=raw["iterations"],
        seconds=_optional(raw, "seconds"),
        condition_number=_optional(raw, "condition_number"),
        warnings=_texts(raw, "warnings"),
        uncertainty=read_uncertainty(raw["uncertainty"], n, len(raw["links"])),
        sides=read_sides(raw.get("symmetric")),
        several_logs=read_several_logs(raw["sessions"], len(raw["links"])),
        provenance=_provenance(raw["provenance"] or {}),
        prediction=_prediction(folder / "predictions.npz", n),
    )


def _recording(raw: Mapping[str, Any]) -> RecordingSummary:
    return RecordingSummary(
        name=str(raw.get("name") or "unnamed recording"),
        duration=_optional(raw, "duration"),
        samples={str(key): int(value) for key, value in (raw.get("samples") or {}).items()},
        history=_texts(raw, "history"),
        split=str(raw.get("split") or ""),
    )


def _errors(percent: Mapping[str, Any], rms: Mapping[str, Any], which: str, n: int) -> Errors:
    return Errors(
        percent=_array(percent, which, (n,)),
        overall=_number(percent, f"{which}_overall"),
        rms=_array(rms, which, (n,)),
    )


def _link(raw: Mapping[str, Any]) -> Link:
    return Link(
        name=str(raw["name"]),
        mass_before=_finite(raw, "mass_before"),
        mass=_finite(raw, "mass"),
        com_before=_array(raw, "com_before", (3,)),
        com=_array(raw, "com", (3,)),
        eigenvalue=_number(raw, "min_relative_eigenvalue"),
    )


def _friction(raw: Mapping[str, Any] | None, n: int) -> IdentifiedFriction | None:
    if not raw:
        return None
    columns = _texts(raw, "columns")
    values = _array(raw, "values", (n, len(columns)))
    return IdentifiedFriction(columns, _number(raw, "coulomb_speed"), values)


def _convergence(raw: Mapping[str, Any] | None) -> Convergence | None:
    if not raw or not raw["iteration"]:
        return None
    shape = (len(raw["iteration"]),)
    empty = [None] * shape[0]
    full = {**raw, "validation": raw.get("validation") or empty}
    return Convergence(*(_array(full, key, shape) for key in Convergence.__dataclass_fields__))


def _provenance(raw: Mapping[str, Any]) -> Provenance:
    def pairs(key: str) -> dict[str, str]:
        return {str(name): str(value) for name, value in sorted((raw.get(key) or {}).items())}

    return Provenance(
        command=str(raw.get("command") or ""),
        versions=pairs("versions"),
        files=pairs("files"),
        model_hash=str(raw.get("model_hash") or ""),
        seed=raw.get("seed"),
    )


def _prediction(path: Path, n: int) -> PredictedTorques:
    fault = f"{_AGAIN}; expected t (N,) and measured, before, after (N, {n})"
    try:
        file = open_npz(require_file(path).read_bytes(), path.name)
        keys = ("t", "measured", "before", "after")
        arrays = {key: np.asarray(file[key], dtype=float) for key in keys}
    except OSError as error:
        raise RuntimeFault(f"cannot read '{path}' ({error.strerror or error}); {fault}") from None
    except (RecordingError, ValueError, KeyError, TypeError):
        raise RuntimeFault(f"'{path}' is damaged; {fault}") from None
    t = arrays.pop("t")
    if t.ndim != 1 or len(t) < 2 or any(a.shape != (len(t), n) for a in arrays.values()):
        shapes = ", ".join(f"{key} {a.shape}" for key, a in [("t", t), *arrays.items()])
        raise RuntimeFault(f"'{path}' holds {shapes}; {fault}")
    # Largest and smallest are NaN where a value is, and no comparison holds.
    if not all(
        x.min() >= -LARGEST_ACCEPTED and x.max() <= LARGEST_ACCEPTED for x in (t, *arrays.values())
    ):
        raise RuntimeFault(f"'{path}' holds NaN or numbers above {LARGEST_ACCEPTED:g}; {fault}")
    return PredictedTorques(t, **arrays)


def _texts(raw: Mapping[str, Any], key: str) -> tuple[str, ...]:
    value = raw["joints"] if key == "joints" else raw.get(key) or []
    if not isinstance(value, list):
        raise TypeError(f"'{key}': expected a list, got {value!r:.40}")
    return tuple(str(item) for item in value)


def _number(raw: Mapping[str, Any], key: str) -> float:
    """Float of a JSON number; null is NaN, which JSON lacks."""
    value = raw[key]
    return float("nan") if value is None else float(value)


def _finite(raw: Mapping[str, Any], key: str) -> float:
    value = float(raw[key])
    if not np.isfinite(value):
        raise ValueError(f"'{key}': expected a number, got {value}")
    return value


def _optional(raw: Mapping[str, Any], key: str) -> float | None:
    return None if raw.get(key) is None else float(raw[key])


def _array(raw: Mapping[str, Any], key: str, shape: tuple[int, ...]) -> Array:
    array = np.array(raw[key], dtype=float)
    if array.shape != shape:
        raise ValueError(f"'{key}': expected the shape {shape}, got {array.shape}")
    return array
