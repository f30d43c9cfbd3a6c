"""`result.json` and `predictions.npz` of a result folder, as the report takes them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.common.files import require_file
from runtime.errors import RecordingError, RuntimeFault
from runtime.identification.result_record import ResultRecord
from runtime.identification.saved_result import LARGEST_ACCEPTED, read_record
from runtime.recording.formats.npz import open_npz

Array = NDArray[np.float64]

_AGAIN = "identify again, or give the output folder of an identification"


@dataclass(frozen=True, slots=True)
class PredictedTorques:
    """Torques over the test split: t (N,) [s] and measured, before, after (N, n)."""

    t: Array
    measured: Array
    before: Array
    after: Array


@dataclass(frozen=True, slots=True)
class Result:
    """Content of the result folder of one identification."""

    record: ResultRecord
    prediction: PredictedTorques


def read_result(folder: Path) -> Result:
    """Read a result folder."""
    record = read_record(folder / "result.json")
    rows = len(record.rows_of_errors[0])
    return Result(record, read_predictions(folder / "predictions.npz", rows))


def read_predictions(path: Path, n: int) -> PredictedTorques:
    """Read predictions.npz of n joints."""
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
