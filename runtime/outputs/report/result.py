"""`result.json` and `predictions.npz` of a result folder, as the report takes them."""

from dataclasses import dataclass
from pathlib import Path

from runtime.identification.result_record import ResultRecord
from runtime.identification.saved_result import read_record
from runtime.identification.statistics_file import read_predictions
from runtime.library import Array


@dataclass(frozen=True, slots=True)
class Result:
    """Content of the result folder of one identification.

    Torques over the test part, measured, before and after (N, r), at the instants t (N,) [s].
    """

    record: ResultRecord
    t: Array
    measured: Array
    before: Array
    after: Array


def read_result(folder: Path) -> Result:
    """Read a result folder."""
    record = read_record(folder / "result.json")
    shape = (len(record.rows_of_errors[0]),)
    return Result(record, **read_predictions(folder, measured=shape, before=shape, after=shape))
