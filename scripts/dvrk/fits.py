"""Fits of an arm to one run, and their errors on another.

τ and every column pass the same low-pass at 3 Hz (rows of momentum; q and dq at 20 Hz), friction
has a memory (Dahl), and the joints are weighted by their residuals in `PASSES` passes of
PC-IDIM-OLS.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from runtime.estimators.classical.pc_ols import fit_pc_ols
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.kept_links import identify_friction
from runtime.identification.problem_setup import assemble
from runtime.identification.saved_result import SavedResult
from runtime.identification.settings import Settings
from runtime.library import Array, Library
from runtime.recording import EVERYTHING, Friction, Preparation, Recording

RATE = 200.0
"""Of the logs, Hz."""
COLUMNS = ("viscous", "coulomb", "offset", "motor_viscous", "motor_coulomb", "dahl")
STROKE = 0.03
"""Stroke of the Dahl column with the smallest error on `psm_one_no_weight` of 0.01 to 0.1, rad."""
CUTOFF, MOTION = 3.0, 20.0
"""Low-pass of the rows, which is that of the publication, and of q and dq in their columns, Hz."""
PASSES = 4


@dataclass(frozen=True, slots=True, eq=False)
class ArmFit:
    """Parameters of a training run and the samples of a test run."""

    lib: Library  # library of the arm
    pi: Array  # pi, phi: standard parameters (10 n,) and friction coefficients (n, k)
    phi: Array
    columns: tuple[str, ...]  # names of the k columns
    test: Samples  # samples of the test run, from 1 s after its beginning to 1 s before its end

    def residual(self, phi: Array | None = None) -> Array:
        """τ minus the torque of the model, (N, n), with other friction coefficients if given."""
        friction = self.test.friction(self.phi if phi is None else phi)
        return np.asarray(self.test.tau - self.test.rigid(self.lib, self.pi) - friction)

    def errors(self, rest: Array, rows: slice = slice(None)) -> Array:
        """Norm of the residual over that of the torque, known torques included, per joint."""
        torque = self.test.tau + self.lib.known_torque(self.test.q)
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
        friction_columns=Friction((*COLUMNS, *springs), dahl_stroke=STROKE),
        preparation=_steps(cutoff),
        validation=unseen,
        test=unseen,
    )
    problem = assembly.problem
    weights = 1.0 / np.var(problem.train.tau, axis=0)
    for _ in range(PASSES):
        problem = replace(problem, weights=weights / weights.mean())
        fit = fit_pc_ols(problem)
        rest = problem.train.tau - problem.train.rigid(lib, fit.pi)
        weights = 1.0 / np.var(rest - problem.train.friction(fit.phi), axis=0)
    samples = samples_of(assembly.parts[2], lib)
    return ArmFit(lib, fit.pi, fit.phi, (*COLUMNS, *springs), samples)


def friction_of_start(fit: ArmFit, data: Path, run: str, seconds: float) -> Array:
    """Friction (n, k) of the first seconds of a run, at the links of the fit: `symgen friction`."""
    lib, friction = fit.lib, Friction(fit.columns, dahl_stroke=STROKE)
    saved = SavedResult(
        robot=lib.name,
        method="pc-ols",
        joints=lib.joint_names,
        units=("",) * lib.n_joints,
        pi=fit.pi,
        friction=friction,
        phi=fit.phi,
        history=(),
        preparation=_steps(CUTOFF),
        model=None,
    )
    start = log(data, run).take(slice(0, round((seconds + 2.0) * RATE)), "Took the start.")
    settings = Settings(preparation=saved.preparation, splitting=EVERYTHING)
    return identify_friction(start, lib, saved, settings).result.phi


def _steps(cutoff: float) -> Preparation:
    return Preparation(
        filter="butterworth", cutoff_hz=cutoff, trim_s=1.0, regressor="momentum", motion_hz=MOTION
    )
