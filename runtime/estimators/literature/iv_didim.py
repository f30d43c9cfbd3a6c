"""IDIM-IV and DIDIM: regressors of a simulation with the last estimate and the same controller.

IDIM-IV takes the regressor Z along that noise-free motion as instruments of the measured one,
b = (Zᵀ W X)⁻¹ Zᵀ W T; DIDIM takes it instead of the measured one, b = (Zᵀ W Z)⁻¹ Zᵀ W T, and needs
the measured torque only. Both start at the first guess without friction. Source: Janot, Vandanjon
& Gautier 2014; Gautier, Janot & Vandanjon 2013.

The file of the controller, computed torque with the URDF's model, is TOML as `simulate` writes it:

    [controller]
    stiffness = 225.0          # K_p, 1/s²: one number, or one per joint
    damping = 30.0             # K_d, 1/s
    rotor = 0.1                # inertia of the motors, reflected to the joints, kg·m²
    rate_hz = 1000.0

    [reference]
    trajectory = "motion.json" # of `excite`, relative to this file
    start = 0.0                # when it began, s of the log's clock
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from runtime.common.records import PerJoint, Positive, Record, record_from_toml
from runtime.errors import IdentificationError, NeedsError, SimulationError
from runtime.estimators.classical.least_squares import (
    Solution,
    fit_of_base,
    pi_of_beta,
    residual,
    reweighted,
    solve,
    weights_of,
)
from runtime.estimators.methods import Method
from runtime.estimators.problem import Fit, Origin, Problem
from runtime.estimators.regression.factor import compress
from runtime.estimators.regression.posterior import ROUNDING
from runtime.estimators.regression.samples import Samples
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import read_trajectory
from runtime.library import Array, Library
from runtime.recording import Recording
from runtime.recording.friction.columns import COULOMB
from runtime.recording.settings import COLUMNS, names_where
from runtime.simulation import Controller, Plant, sample_times
from runtime.simulation.closed_loop import follow
from runtime.simulation.plant import per_joint

CONVERGED = 1e-3  # relative step of the normalised unknowns at which both methods stop
IV_ITERATIONS = 6
DIDIM_ITERATIONS = 8  # limits of the number of simulations
UNCERTAIN = 0.1
"""Standard deviation of the predicted torque, relative to that of the measured torque, from which
an estimate by instruments is rejected."""
_BLOCK = 4096  # samples whose regressor is held at a time
_SIMULATED = names_where(lambda column: column.in_closed_loop)


class _Gains(Record, frozen=True):
    """[controller]."""

    stiffness: PerJoint = 225.0
    damping: PerJoint = 30.0
    rotor: PerJoint = 0.1
    rate_hz: Positive = 1000.0


class _Reference(Record, frozen=True):
    """[reference]."""

    trajectory: Annotated[str, Meta(description="the name of a file that excite has written")]
    start: float = 0.0


class _ControllerFile(Record, frozen=True, kw_only=True):
    controller: _Gains = _Gains()
    reference: _Reference


@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """Closed-loop description: how the robot was moved."""

    reference: Trajectory  # requested motion
    controller: Controller = field(default_factory=Controller)  # gains and model of the controller
    rotor: Array | float = 0.1  # inertia of the motors, (n,) or one number, kg·m²
    rate_hz: float = 1000.0  # rate of the controller, Hz
    start: float = 0.0  # beginning of the reference, s of the recording's clock

    def simulate(self, lib: Library, pi: Array, friction: dict[str, Array], t: Array) -> Recording:
        """Simulated recording of a robot with these parameters, without noise.

        friction: coefficients of columns by name, (n,) each. t: (N,) [s], inside the reference.
        """
        clock = sample_times(self.reference.duration, self.rate_hz)
        since = np.asarray(t) - self.start
        slack = 0.5 / self.rate_hz
        if since[0] < -slack or since[-1] > clock[-1] + slack:
            raise IdentificationError(
                f"the recording goes from {t[0]:.3f} to {t[-1]:.3f} s, the reference from "
                f"{self.start:.3f} to {self.start + clock[-1]:.3f} s; cut the recording, or "
                "correct the start and the trajectory of the controller file"
            )
        reference = np.stack(self.reference.at(lib, clock)[:3], axis=1)
        plant = Plant(pi, rotor=self.rotor, **friction)  # type: ignore[arg-type]
        motion = follow(lib, reference, plant, self.controller, self.rate_hz)

        def at(values: Array) -> Array:
            return np.stack([np.interp(since, clock, column) for column in values.T], axis=1)

        q, dq, ddq, tau = map(at, (motion.q, motion.dq, motion.ddq, motion.link))
        return Recording(t, q, dq, ddq, tau, name="simulated", joint_names=lib.joint_names)


def read_controller(path: Path, lib: Library) -> ClosedLoop:
    """Read a controller file."""
    where = f"the controller file '{path}'"
    stated = record_from_toml(_ControllerFile, path, where, IdentificationError)
    gains, reference = stated.controller, stated.reference
    motion = Path(reference.trajectory)
    if motion.is_absolute() or ".." in motion.parts:
        raise IdentificationError(
            f"'{path}' names the trajectory '{motion}', which does not lie beside it; move it there"
        )
    stiffness, damping, rotor = (
        per_joint(lib.n_joints, getattr(gains, key), f"{key} in '{path}'")
        for key in ("stiffness", "damping", "rotor")
    )
    law = Controller(stiffness=stiffness, damping=damping)
    followed = read_trajectory(path.parent / motion, lib)
    return ClosedLoop(followed, law, rotor, gains.rate_hz, reference.start)


def fit_iv(problem: Problem, log: Origin | None = None) -> Fit:
    """Identify by IDIM-IV with the weights of IDIM-WLS; falls back to IDIM-WLS where it fails."""
    lib, train = problem.lib, problem.train
    log, controller = _controlled(log, "iv")
    kept, weights, _ = reweighted(lib, lambda: (train,), log.friction.columns, problem.left_out)
    now, why = _first(problem), f"the estimate still moves after {IV_ITERATIONS} simulations"
    for iteration in range(1, IV_ITERATIONS + 1):
        try:
            instruments = _along(problem, now, log, controller)
            estimate, deviation = _instrumental(lib, instruments, train, weights)
        except SimulationError as error:
            why = str(error)
            break
        size, step = _change(train, now, estimate, lib)
        now = estimate
        share = float(np.max(deviation / train.tau.std(axis=0)))
        if not share < UNCERTAIN:
            why = (
                f"noise in the measured motion leaves {100 * share:.0f} % of a joint's torque "
                "undetermined"
            )
            break
        if step < CONVERGED * size:
            status = f"converged after {iteration} simulations"
            return fit_of_base(problem, now.beta, now.phi, status, iterations=iteration)
    status = (
        f"not converged, the result of wls is kept: {why}; filter the positions more strongly, or "
        "use didim, which needs the torque only"
    )
    return fit_of_base(problem, kept.beta, kept.phi, status, iterations=iteration)


def fit_didim(problem: Problem, log: Origin | None = None) -> Fit:
    """Identify by DIDIM with weights from its residuals."""
    lib, train = problem.lib, problem.train
    log, controller = _controlled(log, "didim")
    now, weights = _first(problem), np.ones(lib.n_joints)
    status = (
        f"not converged after {DIDIM_ITERATIONS} simulations; check gains, rotors and reference "
        "of the controller file, and the friction columns"
    )
    for iteration in range(1, DIDIM_ITERATIONS + 1):
        try:
            motion = replace(_along(problem, now, log, controller), tau=train.tau)
        except SimulationError as error:
            if iteration == 1:
                raise
            status = f"not converged, the last estimate is kept: {error}"
            break
        statistics = compress(lib, motion, weights)
        estimate = solve(statistics, lib, log.friction.columns, problem.left_out)
        weights, _ = weights_of(residual(lib, motion, estimate).var(axis=0), lib)
        size, step = _change(train, now, estimate, lib)
        now = estimate
        if step < CONVERGED * size:
            status = f"converged after {iteration} simulations"
            break
    return fit_of_base(problem, now.beta, now.phi, status, iterations=iteration)


def _first(problem: Problem) -> Solution:
    lib = problem.lib
    beta = lib.base_matrix @ lib.pi_from_lam(problem.start)
    return Solution(beta, np.zeros(problem.train.columns.shape[1:]), np.nan)


def _controlled(log: Origin | None, method: str) -> tuple[Origin, ClosedLoop]:
    """Origin of the samples, and the closed loop under which they were recorded."""
    controller = log.inputs.get("controller") if log else None
    if log is None or controller is None:
        raise NeedsError(
            f"the method {method} simulates the robot under its controller and needs its "
            "description; give the controller's gains and the reference motion "
            "by --settings controller=FILE.toml"
        )
    return log, controller


def _along(problem: Problem, now: Solution, log: Origin, controller: ClosedLoop) -> Samples:
    """Training samples of the simulated robot with the parameters of the last estimate."""
    names = log.friction.columns
    # Negative friction drives the joints; the next estimate is free to have it again.
    friction = dict(zip(names, now.phi.T, strict=True))
    friction |= {n: np.maximum(x, 0.0) for n, x in friction.items() if COLUMNS[n].is_passive}
    speed = {"coulomb_speed": log.friction.coulomb_speed} if COULOMB.name in names else {}
    pi = pi_of_beta(problem, now.beta)
    return log.aligned(controller.simulate(problem.lib, pi, friction | speed, log.recording.t))


def _instrumental(lib: Library, z: Samples, x: Samples, weights: Array) -> tuple[Solution, Array]:
    """Estimate b = (Zᵀ W X)⁻¹ Zᵀ W T, and the deviation of the torque Z b per joint, (n,).

    The deviation follows from cov b = A⁻¹ Zᵀ W S W Z A⁻ᵀ, A = Zᵀ W X, S of the residuals T − X b.
    """
    n, p = lib.n_joints, len(lib.base_columns) + x.columns[0].size
    # Zᵀ W X, Zᵀ W T, and Zᵀ Z of every joint, block by block.
    product, right, squares = np.zeros((p, p)), np.zeros(p), np.zeros((n, p, p))
    for start in range(0, len(x), _BLOCK):
        part = slice(start, start + _BLOCK)
        both = (samples.rows(part).rows_of_unknowns(lib) for samples in (z, x))
        left, rows = (each.transpose(1, 0, 2) for each in both)
        squares += left.transpose(0, 2, 1) @ left
        product += np.tensordot(weights, left.transpose(0, 2, 1) @ rows, 1)
        right += np.einsum("jik,ij,j->k", left, x.tau[part], weights)
    # Normalised columns, so that the rank decision does not depend on units.
    lengths = np.sqrt(np.einsum("jkk->k", squares))
    lengths = np.where(lengths > 0, lengths, 1.0)
    matrix = product / np.outer(lengths, lengths)
    sigma = np.linalg.svd(matrix, compute_uv=False)
    if not sigma[-1] > ROUNDING * sigma[0]:
        raise IdentificationError(
            "the instruments along the simulated motion do not determine all parameters; record "
            "a richer trajectory, and check that the controller file has the reference of the "
            "recording"
        )
    solved = np.linalg.solve(matrix, right / lengths) / lengths
    beta, phi = np.split(solved, [len(lib.base_columns)])
    # Deviation from cov b, with the variance of the residuals per joint.
    solution = Solution(beta, phi.reshape(n, -1), float(sigma[0] / sigma[-1]))
    variance = residual(lib, x, solution).var(axis=0)
    unit = squares / np.outer(lengths, lengths)
    spread = np.linalg.solve(matrix, np.tensordot(weights**2 * variance, unit, 1))
    covariance = np.linalg.solve(matrix, spread.T)
    return solution, np.sqrt(np.einsum("jkl,kl->j", unit, covariance).clip(0) / len(x))


def _change(train: Samples, before: Solution, after: Solution, lib: Library) -> tuple[float, float]:
    """Size of the new estimate and of its step, both as torque on the training samples."""
    step = Solution(after.beta - before.beta, after.phi - before.phi, np.nan)
    silent = replace(train, tau=np.zeros_like(train.tau))
    sizes = [float(np.linalg.norm(residual(lib, silent, part))) for part in (after, step)]
    return sizes[0], sizes[1]


IV = Method(
    "iv",
    "instrumental variables from a simulation of the closed loop; needs the controller file",
    fit_iv,
    takes_log=True,
    files={"controller": read_controller},
    columns=_SIMULATED,
    objective="minimises no loss of the measured motion",
)
DIDIM = Method(
    "didim",
    "measured torque against the simulated closed loop; needs the controller file",
    fit_didim,
    takes_log=True,
    files={"controller": read_controller},
    unfiltered=True,
    columns=_SIMULATED,
    objective="compares the torque with that of a simulated motion",
)
