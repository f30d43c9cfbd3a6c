"""Bias by feedback: torque noise moves the robot through its control law, and an instrument.

    J δ̈ + s δ̇ + kp δ(t − d) + kd δ̇(t − d) = w,   J = diag M(q) + rotors,   s = ∂(friction)/∂(dq)

Noise w of the torque moves each joint by δ, so that the columns X of the fit correlate with the
residual e = −w, and least squares, Xᵀ W e = 0, is biased. The motion without noise, q − δ, does
not depend on w. Its columns Z are an instrument:

    Zᵀ W e = 0   ⇔   Xᵀ W (e − c) = 0   with   c = X (Xᵀ W X)⁺ (X − Z)ᵀ W e

so that every estimator that is used with τ − c gives the instrumental estimate. δ follows from the
residual; the loop is linear about the motion, without the coupling between the joints.
Source: instrumental variables for systems in closed loop, Gilson & Van den Hof 2005.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from runtime.estimators.regression.samples import Samples, samples_of
from runtime.identification.drive.linearised import MOST_ROWS, bias_columns, torque_rate
from runtime.identification.drive.result import DriveRequest
from runtime.identification.identified import Identification
from runtime.library import Array, Library
from runtime.recording import Friction
from runtime.recording.friction import COLUMNS, JointMotion, columns
from runtime.recording.preprocessing.segments import segments
from runtime.recording.recipes.control_law import ControlLaw

FEEDBACK = "Removed what the control law makes of the torque noise from τ (drive.feedback)."
"""Sentence in the history of the training part."""
MOST_RESPONSE = 0.3
"""Response over the motion, both RMS, above which the loop is not that of the robot: it is
unstable in the model, while the robot moved."""
_STEP = 1e-4
"""Step of the derivative of friction [rad/s, m/s]: far below every width of a Coulomb sign."""
_PRESENT = 1e-4
"""Eigenvalue of the Gram matrix of unit columns, over the largest, below which a direction is left
alone: the prior decides there, and c would be large and depend on the weights of the joints."""


def feedback_torque(
    result: Identification,
    delay: Array,
    request: DriveRequest,
) -> Array | None:
    """The torque c that is subtracted from that of the training rows.

    delay (1,) [s] → (N, n) [N·m, N].
    """
    gains = _gains(result.train.law, result.lib.n_joints)
    posterior = result.uncertainty
    if posterior is None or posterior.contradictions or posterior.model_errors:
        return None
    samples, lib = samples_of(result.train, result.lib), result.lib
    terms = result.friction
    if gains is None or samples.acceleration is None or _is_of_path(samples, terms):
        return None
    rest = samples.tau - samples.rigid(lib, result.pi) - samples.friction(result.phi)
    t, moves = result.train.t, np.zeros((3, *samples.q.shape))
    inertia, slope = _loop(samples, lib, result.pi, result.phi, terms)
    with np.errstate(over="ignore", invalid="ignore"):  # an unstable loop is refused below
        for part in segments(t):
            moves[:, part] = response(
                t[part],
                -rest[part],
                inertia[part],
                slope[part],
                gains,
                np.broadcast_to(delay, (lib.n_joints,)),
            )
        size = np.linalg.norm(moves[0])
    usual = np.linalg.norm(samples.q - samples.q.mean(axis=0))
    if not (np.isfinite(moves).all() and size < MOST_RESPONSE * usual):
        return None
    clean = _moved(samples, -moves, lib, terms)
    taken = np.arange(0, len(samples), -(-len(samples) // MOST_ROWS))
    scale = np.sqrt(result.weights)
    noisy, other = (_rows(result, each, taken, request) for each in (samples, clean))
    if request.bias:  # whose columns hardly depend on the noise
        further = bias_columns(lib, samples.rows(taken), result.pi)
        noisy, other = (np.concatenate([each, further], axis=2) for each in (noisy, other))
    noisy, difference = noisy * scale[:, None], (noisy - other) * scale[:, None]
    slope = np.einsum("ijk,ij->k", difference, rest[taken] * scale)
    c = noisy @ _solved(noisy, slope) / scale
    return np.stack([np.interp(t, t[taken], row) for row in c.T], axis=1)


def response(
    t: Array, noise: Array, inertia: Array, slope: Array, gains: tuple[Array, Array], delay: Array
) -> Array:
    """Motion δ of joints that torque noise moves through a PD law that acts late.

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
    result: Identification, samples: Samples, taken: NDArray[np.int64], request: DriveRequest
) -> Array:
    """Columns of links, friction and delay at some rows, (N, n, p)."""
    part = samples.rows(taken)
    columns_of = [part.base_rows(result.lib), part.friction_rows()]
    if request.delay:
        columns_of.append(-torque_rate(result, samples, request.per_joint)[taken])
    return np.concatenate(columns_of, axis=2)


def _gains(law: ControlLaw | None, n: int) -> tuple[Array, Array] | None:
    """kp and kd on the joint side, (n,) each; None where they vary over the log."""
    if law is None or any(isinstance(x, str) for x in (law.kp, law.kd, law.gear)):
        return None
    kp, kd, gear = (
        np.broadcast_to(np.asarray(x, dtype=float), (n,)) for x in (law.kp, law.kd, law.gear)
    )
    return kp * gear**2, kd * gear**2


def _is_of_path(samples: Samples, terms: Friction) -> bool:
    """Whether friction is that of coupled motors, or depends on the path."""
    records = [COLUMNS[name] for name in terms.columns]
    return samples.coupling is not None or any("dahl_stroke" in each.widths for each in records)


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


def _solved(rows: Array, slope: Array) -> Array:
    """(XᵀX)⁺ g of rows (N, n, p), in the directions that the data determine."""
    flat = rows.reshape(-1, rows.shape[2])
    gram = flat.T @ flat
    lengths = np.sqrt(np.diag(gram))
    lengths = np.where(lengths > 0, lengths, 1.0)
    sizes, turn = np.linalg.eigh(gram / np.outer(lengths, lengths))
    present = sizes > _PRESENT * sizes.max()
    turn = turn[:, present]
    return np.asarray(turn @ ((turn.T @ (slope / lengths)) / sizes[present]) / lengths)
