"""A recording and a library in, identified parameters with their certificates out.

`identify` has the recording prepared and split, hands the `Problem` to the chosen method and holds
the answer against the convex optimum. The document's method is Adam in λ (Sec. 4): its settings
are the presets "simulation" (Table 5.1) and "real" (Table 5.8); "full" is the same descent on all
samples at once, from compressed statistics, which costs less and stops closer to the optimum.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from runtime.estimators.classical import convex_optimum
from runtime.estimators.convex import CAD
from runtime.estimators.descent.drivers import Preset
from runtime.estimators.friction_net import FrictionNet
from runtime.estimators.methods import chosen_method, fit_by
from runtime.estimators.optimizers import Trace
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression import Statistics
from runtime.estimators.regression.residuals import residuals
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.estimators.uncertainty import Uncertainty, uncertainty_of
from runtime.identification import metrics
from runtime.identification.problem_setup import Assembly, assemble
from runtime.library import Array, Library
from runtime.library.parameters import links, mass
from runtime.parallel import one_blas_thread
from runtime.recording import Friction, Preparation, Recording, Split, friction
from runtime.simulation.controller_file import ClosedLoop


@dataclass(frozen=True, slots=True)
class Streamed:
    """What was computed over all rows of a log of which a result holds only windows.

    Attributes:
        samples: rows of the parts, as prepared.
        spans: their first and last instant [s].
        before, after: torque errors on the whole test part, first guess and answer.
    """

    samples: dict[str, int]
    spans: dict[str, tuple[float, float]]
    before: metrics.TorqueError
    after: metrics.TorqueError


@dataclass(frozen=True, slots=True)
class Identification:
    """Identified parameters and what vouches for them.

    Attributes:
        method: one of `METHODS`.
        pi, beta: standard and base parameters; lam is None where π has none.
        phi: friction coefficients (n, k) of `friction.columns`.
        weights: diagonal of W in the loss.
        status: a sentence.
        loss: L on the training samples.
        optimum: smallest loss of any physically consistent model on the same samples; NaN when
            it was not asked for.
        silent: L of τ̂ = 0 on the same samples.
        uncertainty: what the data say and how surely; None when it was not asked for.
        seconds: of the method alone.
        train, validation, test: the prepared recordings.
        one_run: True when they are parts of one recording.
        notes: what was done on the way.
        net: friction beyond φ, learned by "nn".
        sessions: names of several logs, whose offsets are the last columns of φ.
        streamed: where train, validation and test are windows of a longer log.
    """

    method: str
    lib: Library
    pi: Array
    lam: Array | None
    beta: Array
    phi: Array
    friction: Friction
    weights: Array
    status: str
    loss: float
    optimum: float
    silent: float
    uncertainty: Uncertainty | None
    seconds: float
    iterations: int | None
    trace: Trace | None
    train: Recording
    validation: Recording
    test: Recording
    one_run: bool
    seed: int
    notes: tuple[str, ...] = field(default=())
    net: FrictionNet | None = None
    sessions: tuple[str, ...] = ()
    streamed: Streamed | None = None

    def __repr__(self) -> str:
        source = f"{self.lib.name} from {len(self.train)} samples of {self.train.name!r}"
        verdict = f"{'' if self.is_consistent else 'NOT '}consistent; {self.status}"
        return f"Identification({self.method!r}, {source}: {verdict})"

    @property
    def usual_phi(self) -> Array:
        """φ of the columns of `friction`: the offset is the mean of all sessions."""
        count = len(self.sessions)
        if not count:
            return self.phi
        return np.hstack([self.phi[:, :-count], self.phi[:, -count:].mean(axis=1, keepdims=True)])

    def predict(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """τ̂ = Y π + F(dq) φ, (N, n) or (n,), and the net's share where there is one."""
        rigid = self.lib.inverse_dynamics(q, dq, ddq, self.pi)
        if not self.phi.size:
            return rigid
        speed, place, push = (np.atleast_2d(np.asarray(a, dtype=float)) for a in (dq, q, ddq))
        motion = friction.Motion(speed, place, push, self.lib)
        columns = friction.columns(motion, self.friction)
        extra = friction.torque(columns, self.usual_phi, friction.coupling_of_terms(self.friction))
        if self.net is not None:
            extra = extra + self.net.torque(columns)
        return rigid + extra.reshape(rigid.shape)

    def predict_recording(self, recording: Recording) -> Array:
        """τ̂ of a prepared recording, with the friction columns that were filtered with it."""
        return self.predict_samples(samples_of(recording, self.lib))

    def predict_samples(self, samples: Samples) -> Array:
        """τ̂ of prepared samples, or the power of rows of power."""
        return torque_of(self.lib, samples, self.pi, self.phi, self.net)

    def before(self, recording: Recording) -> Array:
        """τ̂ of the model one starts with: the URDF's π, no friction."""
        return samples_of(recording, self.lib).rigid(self.lib, self.lib.pi0)

    @property
    def gap(self) -> float:
        """(L − L*)/L* against the convex optimum L*, both on the training samples.

        Where the data are explained to rounding, L* is replaced by 1e-9 of the loss of τ̂ = 0.
        """
        return (self.loss - self.optimum) / max(self.optimum, 1e-9 * self.silent)

    @property
    def relative_eigenvalues(self) -> Array:
        """Smallest eigenvalue of each P_k over its trace."""
        return self.lib.relative_eigenvalues(self.pi)

    @property
    def is_consistent(self) -> bool:
        """Every link is a body that can exist."""
        smallest = self.relative_eigenvalues.min()
        masses = mass(links(self.pi))
        return bool(smallest >= -metrics.CONSISTENCY_TOLERANCE and (masses > 0).all())


@one_blas_thread
def identify(
    recording: Recording,
    lib: Library,
    method: str | None = None,
    *,
    preset: str | Preset | None = None,
    preparation: Preparation | None = None,
    splitting: Split | None = None,
    friction_columns: Friction | None = None,
    validation: Recording | None = None,
    test: Recording | None = None,
    lam0: ArrayLike | None = None,
    prior: PriorFile | None = None,
    loop: ClosedLoop | None = None,
    seed: int = 0,
    certify: bool = True,
    progress: Callable[[int, float], None] | None = None,
) -> Identification:
    """Find π (and friction) of a robot from a recording.

    Args:
        recording: as read, or already prepared.
        lib: of the robot.
        method: one of `METHODS`; default is "map", or "adam" where a preset is given.
        preset: settings of "adam": a name of `PRESETS`, or your own; default is "full".
        preparation: default is the recording's recipe; without one, missing derivatives only.
        splitting: default is the recipe's; without one, 48 % train, 12 % validation, 40 % test.
        friction_columns: default is the recipe's; without one, no friction.
        validation: a recording of its own, prepared like the first, instead of a split.
        test: likewise; both or neither.
        lam0: first guess, default is the URDF's.
        prior: further knowledge of the bodies, for "map".
        loop: controller and reference of the recording; "iv" and "didim" simulate them.
        seed: of mini-batches.
        certify: False leaves out the convex optimum and the uncertainty, for thousands of trials;
            the gap is then NaN.
        progress: called with iteration and best validation loss.

    Raises:
        RuntimeFault: the data or options do not make an identification problem.
    """
    method = chosen_method(method, preset, prior)
    assembly = assemble(
        recording,
        lib,
        preparation=preparation,
        splitting=splitting,
        friction_columns=friction_columns,
        validation=validation,
        test=test,
        lam0=lam0,
        loop=loop,
        seed=seed,
        progress=progress,
    )
    return identify_assembled(assembly, method, preset=preset, prior=prior, certify=certify)


@one_blas_thread
def identify_assembled(
    assembly: Assembly,
    method: str,
    *,
    preset: str | Preset | None = None,
    prior: PriorFile | None = None,
    certify: bool = True,
) -> Identification:
    """The same for a problem that is assembled already; arguments as for `identify`.

    Raises:
        IdentificationError: the method is unknown, lacks what it needs, or failed.
    """
    problem, parts = assembly.problem, assembly.parts
    lib = problem.lib
    start = time.perf_counter()
    fit = fit_by(problem, method, preset, prior)
    seconds = time.perf_counter() - start
    statistics, optimum = fit.statistics or problem.statistics(), fit.optimum
    guess = lib.pi_from_lam(problem.start)
    if optimum is None:
        optimum = convex_optimum(lib, statistics, guess).loss if certify else np.nan
    sure = None
    if certify:
        kappa = prior.kappa if prior and prior.kappa else CAD
        sure = uncertainty_of(
            lib,
            problem.train,
            fit.pi,
            fit.phi,
            first_guess=guess,
            kappa=kappa,
            statistics=fit.statistics,
            colour=fit.colour,
            compressed=problem.statistics,
        )
        if problem.train.equations < lib.n_joints:  # rows of power know the noise of no joint
            sure = sure.with_noise(residuals(lib, samples_of(parts[0], lib), fit.pi, fit.phi), lib)
    weights = problem.weights if fit.weights is None else fit.weights
    return Identification(
        method=method,
        lib=lib,
        pi=fit.pi,
        lam=fit.lam,
        beta=lib.base_matrix @ fit.pi,
        phi=fit.phi,
        friction=assembly.friction,
        weights=weights,
        status=fit.status,
        loss=_loss(problem, fit, statistics),
        optimum=optimum,
        silent=float(np.mean(problem.train.tau**2 @ weights) / 2),
        uncertainty=sure,
        seconds=seconds,
        iterations=fit.iterations,
        trace=fit.trace,
        train=parts[0],
        validation=parts[1],
        test=parts[2],
        one_run=assembly.one_run,
        seed=problem.seed,
        notes=fit.notes,
        net=fit.net,
    )


def _loss(problem: Problem, fit: Fit, statistics: Statistics) -> float:
    """In the weights of `statistics`: those that the optimum is measured in."""
    if fit.net is None:
        return statistics.value(fit.pi, fit.phi)
    rest = problem.train.tau - torque_of(problem.lib, problem.train, fit.pi, fit.phi, fit.net)
    return float(np.mean(rest**2 @ problem.weights) / 2)


def torque_of(
    lib: Library, samples: Samples, pi: Array, phi: Array, net: FrictionNet | None
) -> Array:
    """τ̂ of a model with its friction, (N, n); the power of rows of power."""
    tau = samples.rigid(lib, pi)
    if phi.size:
        tau = tau + samples.friction(phi)
    return tau if net is None else tau + net.torque(samples.columns)
