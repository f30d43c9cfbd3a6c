"""The result of an identification: parameters, their certificates and the data they come from."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from runtime.common.tables import Table
from runtime.estimators.optimizers import Trace
from runtime.estimators.problem import Fit, Learned
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.estimators.uncertainty import Uncertainty
from runtime.identification import metrics
from runtime.identification.drive.result import DriveFit
from runtime.identification.posterior_file import SavedPosterior, determined
from runtime.identification.result_record import MirroredPair, SessionsPart, error_parts, link_parts
from runtime.identification.result_tables import error_table, link_table, parameter_columns
from runtime.library import Array, Library
from runtime.library.manifest import torque_units
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.friction.coupled_motors import coupling_of_terms
from runtime.recording.friction.model import columns as friction_columns
from runtime.recording.friction.model import torque as friction_torque
from runtime.recording.notebook import Framed
from runtime.recording.recipes.recipe import Recipe
from runtime.recording.recipes.recipe_file import recipe_text
from runtime.recording.row_marks import Marks
from runtime.recording.settings import JointMotion, names_where


@dataclass(frozen=True, slots=True, eq=False)
class WholeLog:
    """Figures over all rows of a streamed log, of which a result holds only windows."""

    samples: dict[str, int]  # prepared rows of every part, by its name
    spans: dict[str, tuple[float, float]]  # first and last instant of every part [s], by its name
    errors: tuple[metrics.TorqueError, ...]  # those of `torque_errors` on the whole test part


@dataclass(frozen=True, slots=True, eq=False)
class Identification(Framed):
    """Identified parameters with their certificates.

    Attributes:
        method: one of `METHODS`.
        lib: library of the robot.
        pi: standard parameters π, (10 n,) [kg, kg·m ×3, kg·m² ×6 per link].
        lam: λ of π, (10 n,); None where π is not physically consistent.
        beta: base parameters β = K π, (n_b,).
        phi: friction coefficients of `friction_columns`, (n, k).
        friction: friction model.
        weights: diagonal of W in the loss, (n,), or (1,) of energy.
        status: how the method ended, as a sentence.
        loss: L on the training samples.
        optimum: smallest loss of any physically consistent model on the same samples; NaN when
            not computed.
        zero_loss: L of τ̂ = 0 on the same samples.
        uncertainty: posterior of the parameters; None when not computed.
        seconds: time of the method alone, s.
        iterations: iterations of the method; None for closed forms.
        trace: losses over the iterations; None for closed forms.
        train: prepared training recording.
        validation: prepared validation recording.
        test: prepared test recording.
        one_run: True when the three are parts of one recording.
        seed: seed of mini-batches and nets.
        notes: sentences on steps that were taken on the way.
        learned: friction beyond φ, where the method learned one.
        log_names: names of several logs, whose offsets are the last columns of φ.
        streamed: figures over all rows, where train, validation and test are windows of a log.
        urdf_phi: friction coefficients fitted with the inertial parameters of the URDF, (n, k);
            None without friction.
        trained: fit to the training part alone, whose errors, loss and gap are reported, where π
            and φ are those of all rows; None where they are those of the training part.
        drive: delay, encoder biases and standard deviations of φ; None where not estimated.
        symmetric: comparison of mirrored joints; empty where it was not requested.
        is_joined: the training part includes the validation part, which nothing is tuned by.
        agreement: comparison of several logs; None for one.
        row_marks: of the rows that were fitted, by which they are recognised in other logs; None of
            a streamed log, and of trials that neither certify nor refit.
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
    zero_loss: float
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
    learned: Learned | None = None
    log_names: tuple[str, ...] = ()
    streamed: WholeLog | None = None
    urdf_phi: Array | None = None
    trained: Fit | None = None
    drive: DriveFit | None = None
    is_joined: bool = False
    symmetric: tuple[MirroredPair, ...] = ()
    agreement: SessionsPart | None = None
    row_marks: Marks | None = None

    def __repr__(self) -> str:
        source = f"{self.lib.name} from {len(self.train)} samples of {self.train.name!r}"
        verdict = f"{'' if self.is_consistent else 'NOT '}consistent; {self.status}"
        return f"Identification({self.method!r}, {source}: {verdict})"

    def tables(self) -> tuple[Table, ...]:
        """Torque errors and bodies of the links."""
        verdict = "consistent" if self.is_consistent else "not physically consistent"
        title = f"{self.lib.name} by {self.method}: {verdict}; {self.status}"
        errors = error_parts(*torque_errors(self))
        return (
            error_table(self.lib.joint_names, torque_units(self.lib.manifest), *errors, title),
            link_table(link_parts(self.lib, self.pi)),
        )

    def columns_of_frame(self) -> dict[str, list[Any]]:
        """Link, parameter, URDF's value, identified value and σ [SI], one row per entry of π."""
        sigma = None if self.uncertainty is None else self.uncertainty.sigma
        names = self.lib.link_names
        return parameter_columns(names, urdf=self.lib.pi0, value=self.pi, sigma=sigma)

    @property
    def usual_phi(self) -> Array:
        """φ of the columns of `friction`, (n, k): the offset is the mean over all logs."""
        count = len(self.log_names)
        if not count:
            return self.phi
        return np.hstack([self.phi[:, :-count], self.phi[:, -count:].mean(axis=1, keepdims=True)])

    @property
    def preparation(self) -> Preparation:
        """Settings of the preparation of the log."""
        return self.train.prepared or Preparation()

    @property
    def recipe(self) -> Recipe | None:
        """Recipe of further logs: that of the log without what holds for its own rows."""
        recipe = self.train.recipe
        return None if recipe is None else recipe.replace(leave_out=(), split=None)

    @property
    def predictions(self) -> dict[str, Any]:
        """Torques of both models over the test part, row marks and recipe."""
        test = samples_of(self.test, self.lib)
        arrays: dict[str, Any] = {
            "t": np.asarray(self.test.t),
            "dq": test.dq,
            "measured": test.tau,
            "before": self.before(self.test),
            "after": self.predict_test(),
        }
        if test.base is None:  # scores of a later log are compared with those of these rows
            arrays |= {"q": test.q, "ddq": test.ddq, "columns": test.columns}
        if self.recipe is not None:
            arrays["recipe"] = recipe_text(self.recipe)
        if self.row_marks is not None:
            arrays["row_marks"] = self.row_marks
        return arrays

    @property
    def posterior(self) -> SavedPosterior | None:
        """Posterior of π and φ; None where what it is computed from was not kept."""
        known, logs = self.uncertainty, len(self.log_names)
        if known is None or known.information is None:
            return None
        root, moved, joints = known.root, known.phi_nuisance, self.lib.n_joints
        return SavedPosterior(known.information, self.pi, root, logs, moved, known.gains, joints)

    @property
    def friction_root(self) -> Array | None:
        """Root of the covariance of `usual_phi`, (n k, ·); None without a posterior."""
        posterior, phi = self.posterior, self.usual_phi
        if posterior is None or self.learned is not None or not phi.size:
            return None
        _, system = posterior.reduced(self.lib)
        if system.lengths.size != self.phi.size:
            return None
        difference = self.phi.ravel() - system.phi(self.pi)
        root = np.column_stack([posterior.phi_rows(system), difference])
        statistics = posterior.information.statistics
        root[~determined(statistics.factor[:, statistics.n_base :])] = np.nan
        root = posterior.usual(root)
        # At the bound 0 of friction that cannot drive a joint.
        bounded = names_where(lambda column: column.is_nonnegative)
        is_bounded = np.array([name in bounded for name in self.friction.columns], dtype=bool)
        root[(is_bounded & (phi == 0)).ravel()] = np.nan
        return root

    @property
    def friction_sigma(self) -> Array | None:
        """Standard deviations of `usual_phi`."""
        root, shape = self.friction_root, self.usual_phi.shape
        return None if root is None else np.linalg.norm(root, axis=1).reshape(shape)

    def predict(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """τ̂ = Y π + F(dq) φ, plus known torques and learned friction where there are such.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities of the same shape [rad/s, m/s].
            ddq: joint accelerations of the same shape [rad/s², m/s²].

        Returns:
            Joint torques of the same shape [N·m, N].
        """
        rigid = self.lib.inverse_dynamics(q, dq, ddq, self.pi) + self.lib.known_torque(q)
        if not self.phi.size:
            return rigid
        speed, position, acceleration = (
            np.atleast_2d(np.asarray(a, dtype=float)) for a in (dq, q, ddq)
        )
        motion = JointMotion(speed, position, acceleration, self.lib)
        columns = friction_columns(motion, self.friction)
        extra = friction_torque(columns, self.usual_phi, coupling_of_terms(self.friction))
        if self.learned is not None:
            extra = extra + self.learned(columns)
        return rigid + extra.reshape(rigid.shape)

    def predict_recording(self, recording: Recording) -> Array:
        """τ̂ of a prepared recording, (N, n), with the friction columns filtered with it."""
        return self.predict_samples(samples_of(recording, self.lib))

    def predict_samples(self, samples: Samples) -> Array:
        """τ̂ of prepared samples, (N, n); their power where the rows are rows of power, (N, 1)."""
        return torque_of(self.lib, samples, self.pi, self.phi, self.learned)

    def predict_test(self) -> Array:
        """τ̂ of the test part by the fit to the training part, (N, n)."""
        fit = self.trained or self
        return torque_of(self.lib, samples_of(self.test, self.lib), fit.pi, fit.phi, self.learned)

    def before(self, recording: Recording) -> Array:
        """τ̂ of the URDF's parameters without friction, (N, n)."""
        return samples_of(recording, self.lib).rigid(self.lib, self.lib.pi0)

    @property
    def has_test(self) -> bool:
        """Whether the errors are those of rows that were not trained on."""
        if self.streamed is not None:
            return self.streamed.spans["test"] != self.streamed.spans["train"]
        # A test log of its own may have the clock of the training log.
        train, test = self.train, self.test
        same_torque = np.array_equal(train.required("tau"), test.required("tau"))
        return not (same_torque and np.array_equal(train.t, test.t))

    @property
    def gap(self) -> float:
        """(L − L*)/L* against the convex optimum L*, both on the training samples.

        Where the data are explained to rounding, L* is replaced by 1e-9 of the loss of τ̂ = 0.
        """
        return (self.loss - self.optimum) / max(self.optimum, 1e-9 * self.zero_loss)

    @property
    def relative_eigenvalues(self) -> Array:
        """Smallest eigenvalue of each pseudo-inertia P_k over its trace, (n,)."""
        return self.lib.relative_eigenvalues(self.pi)

    @property
    def is_consistent(self) -> bool:
        """Whether every link is physically consistent."""
        return metrics.is_consistent(self.lib, self.pi)


def torque_errors(
    result: Identification, pieces: Iterable[Samples] | None = None
) -> tuple[metrics.TorqueError, ...]:
    """Errors on the test part, or pieces of it: URDF, result, and URDF with fitted friction."""
    if result.streamed is not None:
        return result.streamed.errors
    lib, fit = result.lib, result.trained or result
    models = [(lib.pi0, np.zeros(0), None), (fit.pi, fit.phi, result.learned)]
    if result.urdf_phi is not None:
        models.append((lib.pi0, result.urdf_phi, None))
    count, scale, rests = 0, np.zeros(lib.n_joints), np.zeros((len(models), lib.n_joints))
    for samples in pieces or [samples_of(result.test, lib)]:
        count += len(samples)
        scale += np.sum(samples.tau**2, axis=0)
        for k, model in enumerate(models):
            rests[k] += np.sum((samples.tau - torque_of(lib, samples, *model)) ** 2, axis=0)
    size = np.sqrt(scale)
    return tuple(metrics.torque_error_of(np.sqrt(rest), size, count) for rest in rests)


def torque_of(
    lib: Library, samples: Samples, pi: Array, phi: Array, learned: Learned | None = None
) -> Array:
    """τ̂ of a model with its friction: pi (10 n,), phi (n, k) → (N, n) [N·m, N]."""
    tau = samples.rigid(lib, pi) + samples.friction(phi)
    return tau if learned is None else tau + learned(samples.columns)
