"""Fits of an arm to one run, and their errors on another.

τ and every column pass the same low-pass at 3 Hz (rows of momentum; q and dq at 20 Hz), friction
has a memory (Dahl), and the joints are weighted by their residuals in `PASSES` passes of
PC-IDIM-OLS.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from runtime.estimators.classical.pc_ols import fit_pc_ols
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.identified import Identification
from runtime.identification.kept_links import identify_friction
from runtime.identification.problem_setup import assemble
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import read_result
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify_assembled
from runtime.library import Array, Library
from runtime.recording import EVERYTHING, Friction, Preparation, Recording

RATE = 200.0  # of the logs, Hz
COLUMNS = ("viscous", "coulomb", "offset", "motor_viscous", "motor_coulomb", "dahl")
STROKE = 0.03
"""Stroke of the Dahl column with the smallest error on `psm_one_no_weight` of 0.01 to 0.1, rad."""
CUTOFF, MOTION = 3.0, 20.0
"""Low-pass of the rows, which is that of the publication, and of q and dq in their columns, Hz."""
PASSES = 4


@dataclass(frozen=True, slots=True, eq=False)
class ArmFit:
    """Model of a training run, and a test run without its first and last second."""

    result: Identification
    test: Samples

    def residual(self, phi: Array | None = None) -> Array:
        """τ minus the torque of the model, (N, n), with other friction coefficients if given."""
        friction = self.test.friction(self.result.phi if phi is None else phi)
        rigid = self.test.rigid(self.result.lib, self.result.pi)
        return np.asarray(self.test.tau - rigid - friction)

    def errors(self, rest: Array, rows: slice = slice(None)) -> Array:
        """Norm of the residual over that of the torque, known torques included, per joint."""
        torque = self.test.tau + self.result.lib.known_torque(self.test.q)
        return np.asarray(np.linalg.norm(rest[rows], axis=0) / np.linalg.norm(torque[rows], axis=0))


def log(data: Path, name: str) -> Recording:
    """Recording of a run; ":0" and ":1" behind the name are its halves."""
    file, _, half = name.partition(":")
    table = np.loadtxt(data / f"{file}.csv", delimiter=",")
    if half:
        table = np.array_split(table, 2)[int(half)]
    t = np.arange(len(table)) / RATE
    return Recording(t, table[:, :7], table[:, 7:14], None, table[:, 14:], name=name)


def fitted(lib: Library, data: Path, train: str, test: str, cutoff: float = CUTOFF) -> ArmFit:
    """Fit to the run `train`, with the samples of the run `test`."""
    springs = tuple(f"spring:{name}" for name in lib.manifest.springs)
    unseen = log(data, test)
    assembly = assemble(
        log(data, train),
        lib,
        friction=Friction((*COLUMNS, *springs), dahl_stroke=STROKE),
        preparation=_steps(cutoff),
        validation=unseen,
        test=unseen,
    )

    def fit_of(problem: Problem) -> Fit:
        weights = 1.0 / np.var(problem.train.tau, axis=0)
        for _ in range(PASSES):
            problem = replace(problem, weights=weights / weights.mean())
            fit = fit_pc_ols(problem)
            rest = problem.train.tau - problem.train.rigid(lib, fit.pi)
            weights = 1.0 / np.var(rest - problem.train.friction(fit.phi), axis=0)
        return fit

    settings = Settings(method="pc-ols", certify=False, refit=False)
    result = identify_assembled(assembly, settings, fit_of)
    return ArmFit(result, samples_of(assembly.parts[2], lib))


def friction_of_start(fit: ArmFit, data: Path, run: str, seconds: float) -> Array:
    """Friction (n, k) of the first seconds of a run, at the links of the fit: `symgen friction`."""
    start = log(data, run).take(slice(0, round((seconds + 2.0) * RATE)), "Took the start.")
    settings = Settings(preparation=_steps(CUTOFF), split=EVERYTHING)
    with TemporaryDirectory() as folder:
        write_result(fit.result, Path(folder), "scripts/check_dvrk")
        saved = read_result(Path(folder))
    return identify_friction(start, fit.result.lib, saved, settings).result.phi


def _steps(cutoff: float) -> Preparation:
    return Preparation(
        filter="butterworth", cutoff_hz=cutoff, trim_s=1.0, regressor="momentum", motion_hz=MOTION
    )
