"""Linearised model of the drives, and the bias by feedback with an instrument against it.

    J δ̈ + s δ̇ + kp δ(t − d) + kd δ̇(t − d) = w,   J = diag M(q) + rotors,   s = ∂(friction)/∂(dq)

Noise w of the torque moves each joint by δ through the control law, so that the columns X of the
fit correlate with the residual e = −w, and least squares, Xᵀ W e = 0, is biased. The motion without
noise, q − δ, does not depend on w. Its columns Z are an instrument:

    Zᵀ W e = 0   ⇔   Xᵀ W (e − c) = 0   with   c = X (Xᵀ W X)⁺ (X − Z)ᵀ W e

so that every estimator that is used with τ − c gives the instrumental estimate. δ follows from the
residual; the loop is linear about the motion, without the coupling between the joints.
Source: instrumental variables for systems in closed loop, Gilson & Van den Hof 2005.

The linearised model of links, friction, delay and encoder bias around an identified model is

    e = τ(t + δ) − Y(q + b, dq, ddq) π − F φ
    ∂e/∂d = s τ̇,   ∂e/∂b_j = −∂(Y π)/∂q_j,   ∂e/∂ln z_j = −∂(F φ)/∂ln z_j,   δ = s d

The Newton step in (d, b, ln z), where they are unknown, at the most probable (π, φ), and the
covariance of all unknowns come from the same information matrix,

    H = XᵀW X / S + κ ∇²D(π) + 1/σ_b² + 1/σ_z²,

with X of all unknowns, S the density of the residual noise and D the entropic prior (Laplace's
approximation, MacKay 2003, Ch. 27). Columns of π are in units of its prior.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from runtime.estimators.convex.entropic_prior import bodies_of
from runtime.estimators.regression.coloured_noise import coloured_noise_of_basis
from runtime.estimators.regression.model_error import FreeFit, nuisance_of, scatter
from runtime.estimators.regression.posterior import (
    basis_of_joints,
    posterior_of,
    triangle_of_joints,
)
from runtime.estimators.regression.recorded_delay import sign_of_delay
from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.drive.result import DriveRequest
from runtime.identification.identified import Identification
from runtime.library import Array, Integers, Library
from runtime.recording import Friction
from runtime.recording.friction.model import columns
from runtime.recording.preprocessing.segments import rate_of, segments
from runtime.recording.recipes.recipe import ControlLaw
from runtime.recording.settings import COLUMNS, JointMotion, has_memory, signals_for, width_of

ROUGH_ROWS = 600  # rows of passes before the last: those of a low-passed log are nearly redundant
MOST_ROWS, STRETCHES = 6000, 8  # rows above which only as many, in contiguous stretches, are used
_H = 1e-6  # step of a central difference in q [rad, m]: its error is 1e-12 relative, rounding 1e-10
FEEDBACK = "Removed what the control law makes of the torque noise from τ (drive.feedback)."
"""Sentence in the history of the training part."""
MOST_RESPONSE, LESS = 0.03, (1.0, 0.75, 0.5, 0.25)
"""Response over the motion, both RMS, above which the loop is not that of the robot: it is
unstable in the model, while the robot moved, and less of the delay is tried."""
_LOG = 0.1  # step of a central difference in ln z: its error is 2e-3 relative
_STEP = 1e-4  # step of the slope of friction [rad/s, m/s]: far below every width of a Coulomb sign
_PRESENT = 1e-2
"""Singular value of unit columns, over the largest, below which a direction is left alone: the
prior decides there, and c would be large and depend on the weights of the joints."""


@dataclass(frozen=True, slots=True)
class LinearisedDrive:
    """Newton step and standard deviations; of x = (d, b, ln z), those that are unknown."""

    step: Array  # of x, (m,) [s, then rad, m, then 1]
    sigma: Array  # of x, (m,)
    phi_sigma: Array  # of φ by noise alone, (n, k); NaN where a coefficient is not determined
    pi_moved: Array  # what a root of the covariance of x moves π, (10 n, m)
    phi_moved: Array  # the same of φ, (n k, m)


def bias_columns(lib: Library, samples: Samples, pi: Array) -> Array:
    """Columns ∂(Y π)/∂q of the encoder biases, (N, n, n), by central differences of the model."""
    n = lib.n_joints
    columns = np.empty((len(samples), n, n))
    for j in range(n):
        step = np.zeros(n)
        step[j] = _H
        ahead = lib.inverse_dynamics(samples.q + step, samples.dq, samples.ddq, pi)
        behind = lib.inverse_dynamics(samples.q - step, samples.dq, samples.ddq, pi)
        columns[:, :, j] = (ahead - behind) / (2 * _H)
    return columns


def stroke_columns(result: Identification, samples: Samples) -> Array:
    """Columns ∂(F φ)/∂ln z of the strokes of the joints, (N, n, n), by the path of the rows."""
    motion, terms = JointMotion(samples.dq, samples.q, samples.ddq, result.lib), result.friction
    strokes = (np.multiply(terms.dahl_stroke, np.exp(h)) for h in (_LOG, -_LOG))
    ahead, behind = (columns(motion, replace(terms, dahl_stroke=width_of(z))) for z in strokes)
    change = np.einsum("ijk,jk->ij", ahead - behind, result.phi) / (2 * _LOG)
    return change[:, :, None] * np.eye(result.lib.n_joints)


def torque_rate(result: Identification, samples: Samples, per_joint: bool) -> Array:
    """∂e/∂d = s τ̂̇ at the rows of the training part.

    The predicted torque is differentiated: the noise of the logged one, differentiated, would count
    as information on the delay.

    Returns (N, n, 1) [N·m/s].
    """
    rate = rate_of(result.train.t, result.predict_samples(samples)) * sign_of_delay(result.train)
    if not per_joint:
        return rate[:, :, None]
    return rate[:, :, None] * np.eye(rate.shape[1])


def linearised(
    result: Identification,
    request: DriveRequest,
    *,
    x: Array,
    spread: Array,
    kappa: float,
    phi_prior: Array | None = None,
    rough: bool = False,
    known_sigma: Array | None = None,
    used: Array | float = 1.0,
) -> LinearisedDrive:
    """Newton step of delay, biases and strokes, and the standard deviations of all unknowns.

    x (m,) and the standard deviations of its prior about 0, phi_prior (n, k); known_sigma of the
    first of x by other rows than these; used (N, n) is 0 in rows that the result leaves out.
    """
    samples = samples_of(result.train, result.lib)
    lib, pi, phi = result.lib, result.pi, result.phi
    n, k, n_base = lib.n_joints, phi.shape[1], len(lib.base_matrix)
    scale = np.sqrt(result.weights) * np.broadcast_to(used, samples.tau.shape)
    rest = (samples.tau - samples.rigid(lib, pi) - samples.friction(phi)) * scale
    further = np.zeros((*samples.tau.shape, 0))
    if request.delay:
        further = -torque_rate(result, samples, request.per_joint)
    if request.bias:
        further = np.concatenate([further, bias_columns(lib, samples, pi)], axis=2)
    if request.strokes:
        further = np.concatenate([further, stroke_columns(result, samples)], axis=2)
    further = further * scale[:, :, None]
    # The gradient in π and φ vanishes at the most probable model: x alone drives the step.
    pull = np.einsum("ijk,ij->k", further, rest)
    taken = _taken(len(samples), rough)
    part = samples.rows(taken)
    rest, scale = rest[taken], scale[taken]
    rows = part.rows_of_unknowns(lib) * scale[:, :, None]
    rows = np.concatenate([rows, further[taken]], axis=2)
    # One orthogonal factorisation gives the information and the basis for the noise.
    triangle = triangle_of_joints(rows)
    slope = rows.reshape(-1, rows.shape[2]).T @ rest.ravel()
    known = posterior_of(triangle)
    basis = basis_of_joints(rows, known.root)
    left = rest - rows @ known.step(slope)
    density = coloured_noise_of_basis([(basis, left)], 1, known.root.shape[1]).density
    noise = np.sqrt(max(density, np.finfo(float).tiny))
    # Rows that are left out between others lower S as much as N; stretches lower N alone.
    share = len(samples) / len(part)
    more, coarse = (1.0, share) if rough else (np.sqrt(share), 1.0)
    # Columns of π in units of the prior, (κ ∇²D)^(-1/2): there the prior is the identity.
    shrink = block_diag(*bodies_of(lib).spread(pi)) / np.sqrt(kappa)
    data = np.hstack([triangle[:, :n_base] @ (lib.base_matrix @ shrink), triangle[:, n_base:]])
    first = len(pi) + n * k
    slope = np.concatenate([np.zeros(first), pull / (coarse * noise**2) - x / spread**2])
    prior = np.zeros(data.shape[1])
    prior[: len(pi)] = 1.0
    if phi_prior is not None:
        prior[len(pi) : first] = 1.0 / phi_prior.ravel()
    prior[first:] = 1.0 / spread
    posterior = posterior_of(np.vstack([data * (more / noise), np.diag(prior)]))
    sigma = posterior.sigma
    # Of all unknowns, E[y | x] moves with a root L_x of the covariance of x by cov(y, x) L_x⁻ᵀ.
    lower = np.asarray(np.linalg.qr(posterior.root[first:].T, mode="r")).T
    moved = np.linalg.lstsq(lower, posterior.root[first:] @ posterior.root[:first].T, rcond=None)[0]
    wider = np.ones(further.shape[2])
    if density > 0 and wider.size and not rough:
        basis, left = rows.reshape(rest.size, -1) @ known.root, left.ravel()
        fit = FreeFit(part, scale, known.root, basis, rest.ravel() - left, left, ())
        wider = _widening(result, fit, known.root[-wider.size :], density)
    if known_sigma is not None:
        wider[: len(known_sigma)] = known_sigma / sigma[first : first + len(known_sigma)]
    moved = moved * wider[:, None]
    return LinearisedDrive(
        step=posterior.step(slope)[first:],
        sigma=sigma[first:] * wider,
        phi_sigma=sigma[len(pi) : first].reshape(n, k),
        pi_moved=shrink @ moved[:, : len(pi)].T,
        phi_moved=moved[:, len(pi) :].T,
    )


def _widening(result: Identification, fit: FreeFit, of_x: Array, density: float) -> Array:
    """Factor on the σ of x̂ = X Qᵀ r by the scatter of blocks and by nuisance torque, (m,).

    of_x X (m, p), of noise of the density S.
    """
    stroke = np.asarray(result.friction.dahl_stroke)
    nuisance = nuisance_of(result.lib, fit, result.pi, density, stroke=stroke)
    lengths = np.linalg.norm(of_x, axis=1)
    along = of_x / np.maximum(lengths, 1e-300)[:, None]
    rest = (fit.rest - nuisance.mean.ravel()).reshape(nuisance.mean.shape)
    spread = np.diag(scatter(fit.samples, fit.basis @ along.T, rest, density))
    among = np.sum((along @ nuisance.error) ** 2, axis=1)
    return np.sqrt((np.maximum(spread, density) + among) / density)


def _taken(count: int, rough: bool) -> Integers:
    """Evenly spread rows for a rough step, else all rows, or contiguous stretches of a long log."""
    if rough:
        return np.arange(0, count, max(1, count // ROUGH_ROWS))
    if count <= MOST_ROWS:
        return np.arange(count)
    length = MOST_ROWS // STRETCHES
    starts = np.linspace(0, count - length, STRETCHES).astype(int)
    return np.concatenate([np.arange(start, start + length) for start in starts])


def feedback_torque(
    result: Identification, delay: Array, request: DriveRequest, used: Array | float = 1.0
) -> tuple[Array, bool] | None:
    """The torque c (N, n) [N·m, N] that is subtracted from that of the training rows.

    Beside it, whether it is that of the links, too: the loop is that of the model, whose friction
    has no memory, and the model has no other error. used (N, n) is 0 in rows that are left out.
    """
    gains = _gains(result.train.law, result.lib.n_joints)
    posterior = result.uncertainty
    if posterior is None or posterior.contradictions:
        return None
    samples, lib = samples_of(result.train, result.lib), result.lib
    terms = result.friction
    # Friction of coupled motors, or that depends on more than the motion.
    is_of_more = samples.coupling or signals_for(terms.columns)
    if gains is None or samples.acceleration is None or is_of_more:
        return None
    rest = samples.tau - samples.rigid(lib, result.pi) - samples.friction(result.phi)
    t, moves = result.train.t, np.zeros((3, *samples.q.shape))
    inertia, slope = _loop(samples, lib, result.pi, result.phi, terms)
    most = MOST_RESPONSE * np.linalg.norm(samples.q - samples.q.mean(axis=0))
    for share in LESS:
        late = np.broadcast_to(share * delay, (lib.n_joints,))
        with np.errstate(over="ignore", invalid="ignore"):  # an unstable loop is refused below
            for part in segments(t):
                row = t[part], -rest[part], inertia[part], slope[part]
                moves[:, part] = response(*row, gains, late)
            if np.isfinite(moves).all() and np.linalg.norm(moves[0]) < most:
                break
    else:
        return None
    clean = _moved(samples, -moves, lib, terms)
    taken = np.arange(0, len(samples), -(-len(samples) // MOST_ROWS))
    scale = (np.sqrt(result.weights) * np.broadcast_to(used, rest.shape))[taken]
    noisy, other = (_rows(result, each, taken, request) for each in (samples, clean))
    if request.bias:  # whose columns hardly depend on the noise
        further = bias_columns(lib, samples.rows(taken), result.pi)
        noisy, other = (np.concatenate([each, further], axis=2) for each in (noisy, other))
    noisy, difference = noisy * scale[..., None], (noisy - other) * scale[..., None]
    slope = np.einsum("ijk,ij->k", difference, rest[taken] * scale)
    c = noisy @ posterior_of(noisy, rank=_PRESENT).step(slope) / np.where(scale > 0, scale, 1.0)
    of_links = share == 1 and not (has_memory(terms.columns) or posterior.model_errors)
    return np.stack([np.interp(t, t[taken], row) for row in c.T], axis=1), of_links


def response(
    t: Array, noise: Array, inertia: Array, slope: Array, gains: tuple[Array, Array], delay: Array
) -> Array:
    """Motion δ of the joints by torque noise, under a PD law with a delay.

    Second order: every step is taken with the values at its middle, the slope by the trapezoidal
    rule; a delay of less than half a step is none.

    t (N,) [s], noise (N, n) [N·m, N], inertia (N, n), slope (N, n) [N·m·s/rad, N·s/m], gains (n,)
    [N·m/rad, N/m], delay (n,) [s] → (3, N, n).
    """
    (kp, kd), n = gains, noise.shape[1]
    q, v = np.zeros_like(noise), np.zeros_like(noise)
    if len(t) < 2:
        return np.stack([q, v, q])
    steps, joints = np.diff(t), np.arange(n)
    is_direct = delay < np.median(steps) / 2
    # Row, with its fraction, at which the law sees the state.
    seen = np.interp((t[:-1] + steps / 2)[:, None] - delay, t, np.arange(len(t)))
    seen = np.where(is_direct, np.arange(len(t) - 1)[:, None], seen)
    first = np.minimum(seen.astype(int), np.arange(len(t) - 1)[:, None])
    share = seen - first
    w, mass, s = ((each[1:] + each[:-1]) / 2 for each in (noise, inertia, slope))
    for i, h in enumerate(steps):
        at, f = first[i], share[i]
        q_seen = (1 - f) * q[at, joints] + f * q[at + 1, joints]
        v_seen = (1 - f) * v[at, joints] + f * v[at + 1, joints]
        ahead = is_direct * kp * h / 2
        force = w[i] - kp * q_seen - kd * v_seen - (s[i] + ahead) * v[i]
        change = h * force / (mass[i] + h / 2 * (s[i] + is_direct * kd + ahead))
        q[i + 1], v[i + 1] = q[i] + h * (v[i] + change / 2), v[i] + change
    return np.stack([q, v, np.gradient(v, t, axis=0)])


def _rows(
    result: Identification, samples: Samples, taken: Integers, request: DriveRequest
) -> Array:
    """Columns of links, friction and delay at some rows, (N, n, p)."""
    rows = samples.rows(taken).rows_of_unknowns(result.lib)
    if not request.delay:
        return rows
    return np.concatenate([rows, -torque_rate(result, samples, request.per_joint)[taken]], axis=2)


def _gains(law: ControlLaw | None, n: int) -> tuple[Array, Array] | None:
    """kp and kd on the joint side, (n,) each; None where they vary over the log."""
    if law is None or any(isinstance(x, str) for x in (law.kp, law.kd, law.gear)):
        return None
    kp, kd, gear = (
        np.broadcast_to(np.asarray(x, dtype=float), (n,)) for x in (law.kp, law.kd, law.gear)
    )
    return kp * gear**2, kd * gear**2


def _loop(
    samples: Samples, lib: Library, pi: Array, phi: Array, terms: Friction
) -> tuple[Array, Array]:
    """J and s of every row and joint, (N, n) each."""
    n = lib.n_joints
    inertial = [COLUMNS[name].is_inertial for name in terms.columns]
    mass = lib.mass_matrix(samples.q, pi)[:, range(n), range(n)] + phi[:, inertial].sum(axis=1)
    ahead, behind = (
        columns(JointMotion(samples.dq + h, samples.q, samples.ddq, lib), terms)
        for h in (_STEP, -_STEP)
    )
    slope = np.einsum("ijk,jk->ij", ahead - behind, phi) / (2 * _STEP)
    return mass, np.maximum(slope, 0.0)


def _moved(samples: Samples, moves: Array, lib: Library, terms: Friction) -> Samples:
    """Samples at another motion; columns that the preparation left out stay zero."""
    q, dq, ddq = samples.q + moves[0], samples.dq + moves[1], samples.ddq + moves[2]
    change = columns(JointMotion(dq, q, ddq, lib), terms) - columns(
        JointMotion(samples.dq, samples.q, samples.ddq, lib), terms
    )
    change = change * samples.columns.any(axis=0)
    return replace(samples, q=q, dq=dq, acceleration=ddq, columns=samples.columns + change)
