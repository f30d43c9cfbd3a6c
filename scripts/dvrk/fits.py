"""Fits of an arm to one run, and their errors on another.

τ and every column pass the same low-pass at 3 Hz (rows of momentum; q and dq at 20 Hz), friction
has a memory (Dahl), and the joints are weighted by their residuals in `PASSES` passes of
PC-IDIM-OLS.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from scipy.signal import butter, sosfiltfilt

from runtime.estimators.classical.pc_ols import fit_pc_ols
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.kept_links import identify_friction
from runtime.identification.problem_setup import assemble
from runtime.identification.result_record import ResultRecord
from runtime.identification.saved_result import SavedResult, migrated
from runtime.identification.settings import Settings
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
        friction=Friction((*COLUMNS, *springs), dahl_stroke=STROKE),
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
    error = dict.fromkeys(("before", "after"), (0.0,) * lib.n_joints)
    facts = {
        "method": "pc-ols",
        "robot": lib.name,
        "joints": list(lib.joint_names),
        "links": (),
        "consistent": True,
        "torque_error_percent": error | {"before_overall": None, "after_overall": None},
        "torque_rms": error,
    }
    record = msgspec.convert(migrated(facts), ResultRecord)
    saved = SavedResult(record, fit.pi, friction, fit.phi, _steps(CUTOFF))
    start = log(data, run).take(slice(0, round((seconds + 2.0) * RATE)), "Took the start.")
    settings = Settings(preparation=saved.preparation, split=EVERYTHING)
    return identify_friction(start, lib, saved, settings).result.phi


def _steps(cutoff: float) -> Preparation:
    return Preparation(
        filter="butterworth", cutoff_hz=cutoff, trim_s=1.0, regressor="momentum", motion_hz=MOTION
    )


WRIST = slice(3, 7)
PERIOD = 6.0  # of the motions, s


def _low_passed(values: Array, cutoff: float) -> Array:
    sos = butter(4, cutoff, fs=RATE, output="sos")
    return np.asarray(sosfiltfilt(sos, values, axis=0))


def published_wrist(
    lib: Library, data: Path, run: str, rows: Sequence[Mapping[str, Any]]
) -> tuple[Array, Array, Array]:
    """Relative errors of the published wrist on a run, and the level of its friction there.

    Both sides pass the same low-pass, as in `fits`.
    """
    recording = log(data, run)
    q, dq = _low_passed(recording.q, MOTION), _low_passed(recording.required("dq"), MOTION)
    ddq = np.gradient(dq, 1.0 / RATE, axis=0)
    friction, rest = np.zeros_like(q), np.zeros_like(q)
    for row in rows:
        to_x = np.array([row["of"].get(name, 0.0) for name in lib.joint_names])
        x, dx, ddx = q @ to_x, dq @ to_x, ddq @ to_x
        friction += (row["coulomb"] * np.sign(dx) + row["viscous"] * dx)[:, None] * to_x
        rest += (row["rotor"] * ddx + row["offset"] + row["stiffness"] * x)[:, None] * to_x
    inner = slice(round(RATE), -round(RATE))
    tau, friction, rest, q, ddq = (
        _low_passed(values, CUTOFF)[inner, WRIST]
        for values in (recording.required("tau"), friction, rest, q, ddq)
    )
    errors = np.linalg.norm(tau - friction - rest, axis=0) / np.linalg.norm(tau, axis=0)
    levels = _levels(tau, friction, q, ddq)
    length = round(PERIOD * RATE)
    parts = [slice(k, k + length) for k in range(0, len(tau) - length, length)]
    single = [_levels(tau[s], friction[s], q[s], ddq[s]) for s in parts]
    return errors, levels, np.std(single, axis=0, ddof=1)


def _levels(tau: Array, friction: Array, q: Array, ddq: Array) -> Array:
    """s of each joint, beside a free offset, stiffness and rotor."""
    levels = []
    for k in range(tau.shape[1]):
        columns = np.stack([friction[:, k], np.ones(len(tau)), q[:, k], ddq[:, k]], axis=1)
        levels.append(np.linalg.lstsq(columns, tau[:, k], rcond=None)[0][0])
    return np.array(levels)


def one_level(fit: ArmFit, seconds: float) -> tuple[float, Array, Array]:
    """One level of friction of the whole wrist and an offset per joint, of the first seconds."""
    phi = fit.phi.copy()
    phi[:, fit.columns.index("offset")] = 0.0
    friction = fit.test.friction(phi)
    others = fit.residual(phi) + friction  # τ minus the links
    wrist = friction.copy()
    wrist[:, : WRIST.start] = 0.0
    others -= friction - wrist
    n = others.shape[1]
    offsets = np.broadcast_to(np.eye(n), (len(others), n, n))
    columns = np.concatenate([wrist[:, :, None], offsets], axis=2)
    start, scale = slice(0, round(seconds * RATE)), 1.0 / fit.test.tau.std(axis=0)
    rows = (columns[start] * scale[:, None]).reshape(-1, n + 1)
    x = np.linalg.lstsq(rows, (others[start] * scale).ravel(), rcond=None)[0]
    change = x[1:] - fit.phi[:, fit.columns.index("offset")]
    return float(x[0]), change, np.asarray(others - columns @ x)
