"""Ten unknowns on a frozen arm: maximum a posteriori with a ball as the prior.

    τ − Y π_arm − F φ_arm = Y_k π + b + e,   e ~ N(0, diag σ_j²)

Y_k are the columns of the link that carries the payload, b one offset per joint, eliminated by
taking means. Against a run of the same motion without the payload, its residual is subtracted
first: bias and friction cancel, whatever they are. σ_j comes from the residuals in three passes;
correlated residuals count as N_eff samples (`coloured_noise`), in the prior's weight too.
Source: Lee, Wensing & Park 2019 (prior); Swevers et al. 2002 (payload).
"""

from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.convex import NONE, Reduced, convex_problem, minimise, prior_from
from runtime.estimators.regression.coloured_noise import ColouredNoise, coloured_noise_of_rows
from runtime.estimators.regression.samples import samples_of
from runtime.identification.payload.body import NAMES, Body, body_of
from runtime.identification.payload.differential import empty_residual
from runtime.identification.payload.mount import Mount, mount_of
from runtime.identification.payload.reading import ArmModel, arm_model
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, pi_from_parts
from runtime.notebook import html_table
from runtime.parallel import one_blas_thread
from runtime.recording import Preparation, Recording
from runtime.recording.plausibility import require_plausible
from runtime.recording.preprocessing import prepare

BALL_MASS, BALL_RADIUS = 0.5, 0.06
"""The prior: a ball of 0.5 kg and 6 cm with its centre at the mount."""
PASSES = 3
FEWEST = 50
"""Samples below which neither noise nor correlation can be estimated."""
_BLOCK = 4096
_PERFECT = 1e-6
"""Noise relative to the largest torque below which data count as exact."""
_SILENT = 1e-9
"""Part of the columns that varies, below which it is rounding."""
_TOLD = 0.5
"""A value whose σ is above this share of the prior's is the prior's."""
_MODEL_ERROR = 0.1


@dataclass(frozen=True, slots=True)
class Payload:
    """What hangs on the arm, and how well that is known.

    Attributes:
        mount: link and frame.
        pi: (10,) in the link's frame.
        covariance: of π, by N_eff samples.
        body: mass, centre of mass and inertia in the mount's frame, covariance by N_eff.
        white: the same body with the covariance for white noise.
        offsets: b, (n,) N·m or N.
        noise: σ_j, (n,).
        n_samples, n_effective: N and N_eff.
        differential: against a run without payload.
        prior_dominated: names of values that the prior tells rather than the data.
        arm: origin of the arm's model.
        status: a sentence.
        notes: sentences of advice.
    """

    mount: Mount
    pi: Array
    covariance: Array
    body: Body
    white: Body
    offsets: Array
    noise: Array
    n_samples: int
    n_effective: float
    differential: bool
    prior_dominated: tuple[str, ...]
    arm: str
    status: str
    notes: tuple[str, ...]

    def _repr_html_(self) -> str:
        """The ten values with their standard deviations, as a table for notebooks."""
        units = ("kg", *("m",) * 3, *("kg·m²",) * 6)
        rows = [
            (name, f"{value:.6g}", f"{sigma:.2g}", unit)
            for name, value, sigma, unit in zip(
                NAMES, self.body.values, self.body.sigma, units, strict=True
            )
        ]
        title = f"payload on {self.mount.link}, frame {self.mount.frame}: {self.status}"
        return html_table(title, rows, ("parameter", "value", "σ", "unit"))


@one_blas_thread
def identify_payload(
    recording: Recording,
    lib: Library,
    link: str | None = None,
    *,
    arm: ArmModel | None = None,
    empty: Recording | None = None,
    preparation: Preparation | None = None,
    kappa: float = NONE,
) -> Payload:
    """π and b of τ − Y π_arm − F φ_arm = Y_k π + b + e: the payload of a recording.

    Args:
        recording: with the payload.
        lib: of the robot.
        link: that carries it; None is the link of the tip.
        arm: parameters and friction; default is the URDF without friction.
        empty: the same motion without the payload.
        preparation: of both recordings; default is that of the recipe.
        kappa: trust in the prior, 1 is next to none.

    Raises:
        RuntimeFault: the recordings do not make a problem; the message says what to do.
    """
    mount, model = mount_of(lib, link), arm or arm_model(lib)
    run, residual, columns = _rows(recording, lib, mount, model, preparation)
    if len(run) < FEWEST:
        raise IdentificationError(
            f"the recording '{recording.name}' leaves {len(run)} samples, a payload needs "
            f"{FEWEST} or more; record for longer"
        )
    if empty is not None:
        bare, residual0, _ = _rows(empty, lib, mount, model, preparation)
        residual = residual - empty_residual(run, bare, residual0, lib.joint_names)
    found = _solved(mount, columns, residual, kappa)
    return _told(found, mount, columns, model, empty is not None)


@dataclass(frozen=True, slots=True)
class _Found:
    pi: Array
    prior: Array
    noise: Array
    errors: Array
    offsets: Array
    white: Array
    covariance: Array
    n_effective: float
    converged: bool


def _rows(
    recording: Recording,
    lib: Library,
    mount: Mount,
    model: ArmModel,
    preparation: Preparation | None,
) -> tuple[Recording, Array, Array]:
    """The prepared run, τ − Y π_arm − F φ_arm (N, n), and Y_k (N, n, 10)."""
    require_plausible(recording, lib)
    bare = recording.replace(columns=None, column_names=())
    prepared = prepare(bare, preparation, model.friction, lib=lib)
    s = samples_of(prepared, lib)
    residual = s.tau - lib.inverse_dynamics(s.q, s.dq, s.ddq, model.pi)
    if model.phi.size:
        residual = residual - s.friction(model.phi)
    columns = [
        lib.regressor(*(a[i : i + _BLOCK] for a in (s.q, s.dq, s.ddq)))[:, :, mount.columns]
        for i in range(0, len(s), _BLOCK)
    ]
    return prepared, residual, np.concatenate(columns)


def _solved(mount: Mount, columns: Array, residual: Array, kappa: float) -> _Found:
    """Three passes of weights, each with its maximum a posteriori."""
    count, n, _ = columns.shape
    means, level = columns.mean(axis=0), residual.mean(axis=0)
    rows, target = columns - means, residual - level
    prior = prior_from(mount.bodies, _ball(mount))
    if np.linalg.norm(rows) <= _SILENT * np.linalg.norm(columns):
        raise IdentificationError(
            f"nothing in this recording moves the link '{mount.link}', so a payload on it cannot "
            "be told from a torque offset; record a motion that turns it against gravity"
        )
    noise, spread = np.ones(n), float(np.abs(residual).max())
    used, pi, errors = 1 + N_PARAMETERS / n, prior.centre, target
    for done in range(PASSES + 1):
        scaled = (rows / noise[:, None]).reshape(-1, rows.shape[2])
        aim = (target / noise).ravel()
        triangle: Array = np.asarray(np.linalg.qr(np.column_stack([scaled, aim]), mode="r"))
        data = Reduced(
            factor=triangle[:-1, :-1],
            target=triangle[:-1, -1],
            rest=float(triangle[-1, -1] ** 2),
            count=float(count),
            freedom=float(count * n - N_PARAMETERS - n),
        )
        coloured = ColouredNoise(data.variance, data.variance)
        if done == 0:  # as if all were noise: from far away Newton needs the prior's guidance
            whole = float(aim @ aim) / aim.size
            coloured = ColouredNoise(whole, whole)
        elif done == PASSES:
            levels = np.broadcast_to(np.eye(n), (count, n, n)) / np.sqrt(count)
            own = np.concatenate([rows / noise[:, None], levels], axis=2)
            coloured = coloured_noise_of_rows(own, target / noise)
        gamma = kappa * max(coloured.density, _PERFECT**2) / count
        found = minimise(convex_problem(data, prior, gamma), pi)
        pi = found.pi
        errors = target - rows @ pi
        power = np.sum(errors**2, axis=0) / max(count - used * coloured.inflation, 1.0)
        noise = np.sqrt(np.maximum(power, (_PERFECT * spread) ** 2 + 1e-300))
    shape = np.linalg.inv(count * found.hessian())
    return _Found(
        pi=pi,
        prior=np.asarray(np.linalg.inv(kappa * _curvature(mount, pi))),
        noise=noise,
        errors=errors,
        offsets=level - means @ pi,
        white=coloured.variance * shape,
        covariance=coloured.density * shape,
        n_effective=count / coloured.inflation,
        converged=found.converged,
    )


def _curvature(mount: Mount, pi: Array) -> Array:
    return np.asarray(mount.bodies.curvature(pi)[1][0])


def _ball(mount: Mount) -> Array:
    """π of the prior in the link's frame."""
    size = 0.4 * BALL_MASS * BALL_RADIUS**2
    at_mount = pi_from_parts(BALL_MASS, 0.0, [size, size, size, 0, 0, 0])
    return np.asarray(np.linalg.solve(mount.to_frame, at_mount))


def _told(
    found: _Found, mount: Mount, columns: Array, model: ArmModel, differential: bool
) -> Payload:
    """The answer in the mount's frame, with its status and advice."""
    turn = mount.to_frame

    def body(covariance: Array) -> Body:
        return body_of(mount.bodies, turn @ found.pi, turn @ covariance @ turn.T)

    known, prior = body(found.covariance), body(found.prior)
    weak = tuple(
        name
        for name, sigma, before in zip(NAMES, known.sigma, prior.sigma, strict=True)
        if sigma > _TOLD * before
    )
    count = len(columns)
    own = float(np.linalg.norm(columns @ found.pi))
    share = float(np.linalg.norm(found.errors)) / max(own, 1e-300)
    return Payload(
        mount=mount,
        pi=found.pi,
        covariance=found.covariance,
        body=known,
        white=body(found.white),
        offsets=found.offsets,
        noise=found.noise,
        n_samples=count,
        n_effective=found.n_effective,
        differential=differential,
        prior_dominated=weak,
        arm=model.origin,
        status=_status(known, weak, found.converged),
        notes=_notes(weak, share, model, differential),
    )


def _status(body: Body, weak: tuple[str, ...], converged: bool) -> str:
    if not converged:
        return "the search stopped early; check the recording for outliers and the units of torque"
    if body.mass < 3 * body.sigma[0]:
        return (
            f"no payload can be told from none ({1e3 * body.mass:.1f} g, σ "
            f"{1e3 * body.sigma[0]:.1f} g)"
        )
    if "mass" in weak:
        return "the recording does not determine the mass; move the payload against gravity"
    return f"found {body.mass:.4f} kg ± {1.96 * body.sigma[0]:.4f} kg (95 %)"


def _notes(
    weak: tuple[str, ...], share: float, model: ArmModel, differential: bool
) -> tuple[str, ...]:
    notes = []
    if weak:
        notes.append(
            f"the prior rather than the data tells {', '.join(weak)}; a motion with faster turns "
            "about all axes of the payload would show them"
        )
    if share > _MODEL_ERROR and not differential:
        notes.append(
            f"what stays unexplained is {100 * share:.0f} % of the payload's torque, so that the "
            "arm's model errs more than the sensors; record the same motion empty, or give a model "
            "identified on the empty arm"
        )
    if not model.phi.size and not differential:
        notes.append("friction of the arm counts as zero; give a model or an empty run")
    return tuple(notes)
