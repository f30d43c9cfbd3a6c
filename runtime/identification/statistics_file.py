"""statistics.npz: the compressed training samples of one unit, all that `fleet` needs of its log.

    ‖R [K π; φ] − r‖² / S    over base parameters K π and friction coefficients φ

R and r are those of the result, S is the variance with which the noise enters the unknowns. The
size does not depend on the length of the log (about 20 kB for seven joints), and no sample of the
motion can be computed from it.
"""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.common.files import bytes_of, replacing
from runtime.common.user_builds import NAME
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.regression import Statistics
from runtime.identification.identified import Identification
from runtime.library import Array, Library
from runtime.recording.formats.npz import open_npz
from runtime.recording.friction import OFFSET
from runtime.recording.settings import WIDTHS

FILE = "statistics.npz"
FORMAT = 1
"""Version of the file; a later one is refused."""
MARK = "symgen_statistics"
"""Key of the version, by which the file is recognised."""
LARGEST_NUMBER = 1e100
"""Size from which on a number is damage: its square times that of another overflows."""
_ARRAYS = ("factor", "target", "base_matrix")
_NUMBERS = ("rest", "n_samples", "density")


@dataclass(frozen=True, slots=True)
class UnitStatistics:
    """Compressed samples of one unit.

    Attributes:
        unit: name of the unit.
        robot: name of the robot.
        joints: names of its joints, (n,).
        columns: names of the k friction columns of a joint; offsets of several logs repeat.
        widths: widths of friction columns, in the order of `WIDTHS` [rad/s, rad/s, rad].
        statistics: R and r of all training samples, weighted.
        density: S, variance with which the noise enters the unknowns.
        noise: standard deviation of the torque per joint that the samples are weighted by, (n,)
            [N·m, N]; None of a regressor that is not that of the torque, and of older files.
    """

    unit: str
    robot: str
    joints: tuple[str, ...]
    columns: tuple[str, ...]
    widths: tuple[float, float, float]
    statistics: Statistics
    density: float
    noise: Array | None = None

    @property
    def shared(self) -> tuple[str, ...]:
        """Names of the columns that belong to the whole log."""
        return tuple(name for name, count in Counter(self.columns).items() if count == 1)


def statistics_of(result: Identification, unit: str) -> UnitStatistics:
    """Compressed training samples of a result."""
    information = None if result.uncertainty is None else result.uncertainty.information
    if information is None:
        raise IdentificationError(
            f"expected a result with an uncertainty, got one of '{result.method}' without; leave "
            "out --save-statistics, or identify with certify=True"
        )
    facts = result.friction.facts()
    slow, peak, stroke = (float(facts[key]) for key in WIDTHS)
    return UnitStatistics(
        unit,
        result.lib.name,
        result.lib.joint_names,
        _columns(result),
        (slow, peak, stroke),
        information.statistics,
        information.density,
        _noise(result),
    )


def write_statistics(known: UnitStatistics, path: Path) -> None:
    """Write compressed samples, as a whole or not at all."""
    s = known.statistics
    values = {
        MARK: FORMAT,
        "unit": known.unit,
        "robot": known.robot,
        "joints": known.joints,
        "columns": known.columns or ("",),
        "widths": known.widths,
        "factor": s.factor,
        "target": s.target,
        "base_matrix": s.base_matrix,
        "rest": s.rest,
        "n_samples": s.n_samples,
        "density": known.density,
        "noise": () if known.noise is None else known.noise,
        "model_hash": s.model_hash,
    }
    with replacing(path) as file:
        np.savez_compressed(file, **{key: np.asarray(value) for key, value in values.items()})  # type: ignore[arg-type]


def read_statistics(path: Path) -> UnitStatistics:
    """Read the compressed samples of one unit."""
    try:
        file = open_npz(bytes_of(path), path.name)
        version = int(file[MARK])
        if version != FORMAT:
            raise IdentificationError(
                f"expected statistics of version {FORMAT} in '{path}', got version {version}; "
                "install the version of symgen that wrote them, or identify again"
            )
        arrays = {key: np.array(file[key], dtype=float) for key in _ARRAYS}
        numbers = {key: float(file[key]) for key in _NUMBERS}
        noise = np.array(file["noise"], dtype=float) if "noise" in file else np.empty(0)
        slow, peak, stroke = map(float, file["widths"])
        joints, columns = (tuple(map(str, file[key])) for key in ("joints", "columns"))
        columns = tuple(name for name in columns if name)
        unit, robot, model_hash = (str(file[key]) for key in ("unit", "robot", "model_hash"))
    except FileNotFoundError:
        raise IdentificationError(
            f"there are no statistics at '{path}'; write them with: identify --save-statistics"
        ) from None
    except IdentificationError:
        raise
    except (OSError, RecordingError, ValueError, KeyError, TypeError, OverflowError):
        raise IdentificationError(
            f"'{path}' is damaged or holds no compressed statistics; identify that unit again with "
            "--save-statistics"
        ) from None
    size, base = arrays["target"].size, arrays["base_matrix"]
    fits = (
        NAME.fullmatch(robot)
        and len(set(joints)) == len(joints)
        and arrays["factor"].shape == (size, size)
        and base.ndim == 2
        and size == len(base) + len(joints) * len(columns)
        and all((np.abs(each) < LARGEST_NUMBER).all() for each in arrays.values())
        and np.isfinite([*numbers.values(), slow, peak, stroke]).all()
        and numbers["rest"] >= 0
        and numbers["n_samples"] > 0
        and numbers["density"] > 0
        and noise.shape in {(0,), (len(joints),)}
        and ((noise > 0) & (noise < LARGEST_NUMBER)).all()
    )
    if not fits:
        raise IdentificationError(
            f"'{path}' is damaged (its arrays do not fit together); identify that unit again with "
            "--save-statistics"
        )
    statistics = Statistics(
        **arrays, rest=numbers["rest"], n_samples=numbers["n_samples"], model_hash=model_hash
    )
    widths = (slow, peak, stroke)
    return UnitStatistics(
        unit,
        robot,
        joints,
        columns,
        widths,
        statistics,
        numbers["density"],
        noise if noise.size else None,
    )


def require_robot(known: UnitStatistics, lib: Library, path: Path) -> UnitStatistics:
    """Check that statistics belong to a robot."""
    base: Array = known.statistics.base_matrix
    same = known.joints == lib.joint_names and base.shape == lib.base_matrix.shape
    if not (same and np.allclose(base, lib.base_matrix, atol=1e-9)):
        raise IdentificationError(
            f"expected statistics of '{lib.name}', but '{path}' holds those of '{known.robot}' "
            f"(model {known.statistics.model_hash[:12]}), whose joints or base parameters differ; "
            "keep one folder per type of robot"
        )
    return known


def _noise(result: Identification) -> Array | None:
    """σ of the rows of every joint, where they are those of the torque."""
    prepared = result.train.prepared
    of_torque = prepared is None or prepared.regressor == "acceleration"
    alike = result.weights.shape == (result.lib.n_joints,)
    return 1 / np.sqrt(result.weights) if of_torque and alike else None


def _columns(result: Identification) -> tuple[str, ...]:
    """Names of the columns of φ, the same for every joint; offsets of several logs repeat."""
    names, logs = result.friction.columns, len(result.log_names)
    if logs:
        return (
            *(name for name in names if name != OFFSET.name),
            *(OFFSET.name for _ in range(logs)),
        )
    return (result.train.column_names or names) if result.phi.size else ()
