"""statistics.npz: the compressed training samples of one unit for `fleet`.

    ‖R [K π; φ] − r‖² / S    over base parameters K π and friction coefficients φ

R and r are those of the result, S is the variance with which the noise enters the unknowns. The
size does not depend on the length of the log (about 20 kB for seven joints), and no sample of the
motion can be computed from it.
"""

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from runtime.common.files import bytes_of
from runtime.common.records import Positive
from runtime.common.user_builds import NAME
from runtime.errors import IdentificationError
from runtime.estimators.regression.factor import Statistics
from runtime.identification.free_base.result import FreeBaseIdentification
from runtime.identification.identified import Identification
from runtime.identification.saved_result import LARGEST_ACCEPTED
from runtime.library import Array, Library
from runtime.recording.formats.npz import open_npz, record_from_arrays, refusing, write_arrays
from runtime.recording.friction.columns import OFFSET
from runtime.recording.settings import WIDTHS

FILE = "statistics.npz"
FORMAT = 1  # version of the file; a later one is refused
MARK = "symgen_statistics"  # key of the version, by which the file is recognised


@dataclass(frozen=True, slots=True, eq=False)
class UnitStatistics:
    """Compressed samples of one unit."""

    statistics: Statistics  # of all training samples, weighted
    density: Positive  # S, variance with which the noise enters the unknowns
    unit: str  # name of the unit
    robot: str  # name of the robot
    joints: tuple[str, ...]  # names of its joints, (n,)
    widths: tuple[float, float, float]  # of columns, in the order of `WIDTHS` [rad/s, rad/s, rad]
    columns: tuple[str, ...] = ()  # k friction columns of a joint; offsets of logs repeat
    # standard deviation of the torque per joint that the samples are weighted by, (n,) [N·m, N];
    # None of a regressor that is not that of the torque, and of older files
    noise: Array | None = None

    @property
    def shared(self) -> tuple[str, ...]:
        """Names of the columns that belong to the whole log."""
        return tuple(name for name, count in Counter(self.columns).items() if count == 1)


def statistics_of(result: Identification | FreeBaseIdentification, unit: str) -> UnitStatistics:
    """Compressed training samples of a result."""
    posterior, lib, terms, noise = result.posterior, result.lib, result.friction, None
    if posterior is None:
        raise IdentificationError(
            f"expected a result with an uncertainty, got one of '{lib.name}' without; leave "
            "out the setting save_statistics, or identify with certify"
        )
    columns = terms.columns
    if isinstance(result, Identification):
        columns = _columns(result)
        # The rows have a standard deviation where they are those of the torque.
        of_torque = result.preparation.regressor == "acceleration"
        if of_torque and result.weights.shape == (lib.n_joints,):
            noise = 1 / np.sqrt(result.weights)
    known, of_robot = posterior.information, (lib.name, lib.joint_names)
    slow, peak, stroke = (float(np.mean(getattr(terms, key))) for key in WIDTHS)
    widths = slow, peak, stroke
    return UnitStatistics(known.statistics, known.density, unit, *of_robot, widths, columns, noise)


def write_statistics(known: UnitStatistics, path: Path) -> None:
    """Write compressed samples, as a whole or not at all."""
    write_arrays(path, replace(known, columns=known.columns or ("",)), **{MARK: FORMAT})


def read_statistics(path: Path) -> UnitStatistics:
    """Read the compressed samples of one unit."""
    again = "identify that unit again with --settings save_statistics=true"
    with refusing(
        f"there are no statistics at '{path}'; write them with: identify --settings "
        "save_statistics=true",
        f"'{path}' is damaged or holds no compressed statistics; {again}",
    ):
        file = open_npz(bytes_of(path), path.name)
        version = int(file[MARK])
        if version != FORMAT:
            raise IdentificationError(
                f"expected statistics of version {FORMAT} in '{path}', got version {version}; "
                "install the version of symgen that wrote them, or identify again"
            )
        known = record_from_arrays(UnitStatistics, file, path.name)
    known = replace(known, columns=tuple(filter(None, known.columns)))
    data, joints = known.statistics, known.joints
    size, base = data.target.size, data.base_matrix
    noise = np.ones(len(joints)) if known.noise is None else known.noise
    fits = (
        NAME.fullmatch(known.robot)
        and len(set(joints)) == len(joints)
        and data.factor.shape == (size, size)
        and base.ndim == 2
        and size == len(base) + len(joints) * len(known.columns)
        and all((np.abs(x) < LARGEST_ACCEPTED).all() for x in (data.factor, data.target, base))
        and noise.shape == (len(joints),)
        and ((noise > 0) & (noise < LARGEST_ACCEPTED)).all()
    )
    if not fits:
        raise IdentificationError(f"'{path}' is damaged (its arrays do not fit together); {again}")
    return known


def require_robot(known: UnitStatistics, lib: Library, path: Path) -> UnitStatistics:
    """Check that statistics belong to a robot."""
    base = known.statistics.base_matrix
    same = known.joints == lib.joint_names and base.shape == lib.base_matrix.shape
    if not (same and np.allclose(base, lib.base_matrix, atol=1e-9)):
        raise IdentificationError(
            f"expected statistics of '{lib.name}', but '{path}' holds those of '{known.robot}' "
            f"(model {known.statistics.model_hash[:12]}), whose joints or base parameters differ; "
            "keep one folder per type of robot"
        )
    return known


def _columns(result: Identification) -> tuple[str, ...]:
    """Names of the columns of φ, the same for every joint; offsets of several logs repeat."""
    names, logs = result.friction.columns, len(result.log_names)
    if logs:
        return (
            *(name for name in names if name != OFFSET.name),
            *(OFFSET.name for _ in range(logs)),
        )
    return (result.train.column_names or names) if result.phi.size else ()
