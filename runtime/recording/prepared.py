"""A prepared recording: every signal that an identification needs is present and finite.

    accelerations   τ = Y(q, dq, ddq) β + F φ      `DifferentiatedRecording`, with ddq
    balances        τ̂ = rows β + F φ               `BalancedRecording`, with rows without ddq

A `Recording` has what its log had; these classes have no optional fields.
"""

import dataclasses
from dataclasses import dataclass
from typing import Self

import numpy as np

from runtime.errors import IdentificationError
from runtime.recording.recording import FloatArray, Recording


@dataclass(frozen=True, slots=True, eq=False)
class PreparedRecording:
    """Motion, torque and friction columns of n joints at N instants, without optional fields."""

    name: str  # of the recording
    t: FloatArray  # (N,) s
    q: FloatArray  # (N, n) rad or m
    dq: FloatArray  # (N, n) rad/s or m/s
    # (N, n) N·m or N; the power dq τ of each joint where the rows are those of power
    tau: FloatArray
    columns: FloatArray  # (N, n, k) friction columns, k = 0 without friction
    column_names: tuple[str, ...]  # k names

    def __len__(self) -> int:
        return len(self.t)

    @classmethod
    def of(cls, recording: Recording) -> Self:
        """The complete recording.

        Raises:
            IdentificationError: a signal is missing, or a value is not finite.
        """
        fields = {item.name for item in dataclasses.fields(cls)}
        needed = [key for key in ("dq", "ddq", "tau", "rows") if key in fields]
        missing = [key for key in needed if getattr(recording, key) is None]
        if missing:
            raise IdentificationError(
                f"identification needs q, dq, ddq and tau, the recording '{recording.name}' has no "
                f"{', '.join(missing)}; let preprocessing.prepare differentiate it"
            )
        columns = recording.columns
        if columns is None:
            columns = np.zeros((*recording.q.shape, 0))
        arrays = {"q": recording.q, "columns": columns}
        arrays |= {key: recording.required(key) for key in needed}
        dense = {key: np.ascontiguousarray(each, dtype=float) for key, each in arrays.items()}
        if not all(np.isfinite(each).all() for each in dense.values()):
            raise IdentificationError(
                f"the recording '{recording.name}' holds NaN or infinite values; "
                "drop those rows before identifying"
            )
        names = recording.column_names
        return cls(name=recording.name, t=recording.t, column_names=names, **dense)


@dataclass(frozen=True, slots=True, eq=False)
class DifferentiatedRecording(PreparedRecording):
    """A prepared recording with accelerations."""

    ddq: FloatArray  # (N, n) rad/s² or m/s²


@dataclass(frozen=True, slots=True, eq=False)
class BalancedRecording(PreparedRecording):
    """A prepared recording with rows of the regressor that were computed without accelerations."""

    rows: FloatArray  # (N, m, n_b), m = n for momentum, 1 for the power of all joints


def prepared_of(recording: Recording) -> DifferentiatedRecording | BalancedRecording:
    """The complete recording, with rows where it has them, else with accelerations."""
    if recording.rows is not None:
        return BalancedRecording.of(recording)
    return DifferentiatedRecording.of(recording)
