"""A small net per joint for what linear friction leaves over, trained in NumPy.

    y_j(x) = b + Σ_h v_h tanh(W_h x + c_h),   4 units, x the friction columns of the joint, scaled

min Σ (y − target)²/s² + α N ‖θ‖² by Levenberg–Marquardt; α is chosen on validation samples, and no
net at all is one of the choices. Inputs are the joint's own motion only: torque or position as
input would learn one run by heart.
"""

from dataclasses import dataclass

import numpy as np

from runtime.library import Array

UNITS = 4
DECAYS = (1e-4, 1e-3, 1e-2)
"""α, from which validation chooses."""
STEPS = 60
_FLAT = 1e-6
"""Relative decrease of the loss below which training stops."""


@dataclass(frozen=True, slots=True)
class FrictionNet:
    """Nets of all joints.

    Attributes:
        theta: (n, UNITS (k + 2) + 1), per joint [W, c, v, b].
        scale: of the k inputs, (n, k).
    """

    theta: Array
    scale: Array

    def torque(self, columns: Array) -> Array:
        """(N, n) N·m from friction columns (N, n, k)."""
        parts = [
            _forward(theta, columns[:, j] / self.scale[j])[0] for j, theta in enumerate(self.theta)
        ]
        return np.stack(parts, axis=1)


def train(
    columns: Array,
    target: Array,
    held_columns: Array,
    held_target: Array,
    rng: np.random.Generator,
) -> FrictionNet:
    """Nets for target (N, n) from columns (N, n, k), weighed on held-out samples."""
    n, k = columns.shape[1:]
    scale = np.sqrt(np.mean(columns**2, axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    theta = np.zeros((n, UNITS * (k + 2) + 1))
    for j in range(n):
        x, held = columns[:, j] / scale[j], held_columns[:, j] / scale[j]
        best = float(np.mean(held_target[:, j] ** 2))
        start = rng.normal(size=theta.shape[1]) / np.sqrt(k)
        for decay in DECAYS:
            found = _descend(start, x, target[:, j], decay)
            error = float(np.mean((_forward(found, held)[0] - held_target[:, j]) ** 2))
            if error < best:
                best, theta[j] = error, found
    return FrictionNet(theta, scale)


def _forward(theta: Array, x: Array) -> tuple[Array, Array]:
    """y (N,) and the activations (N, UNITS)."""
    w, c, v, b = _parts(theta, x.shape[1])
    hidden = np.tanh(x @ w.T + c)
    return hidden @ v + b, hidden


def _parts(theta: Array, k: int) -> tuple[Array, Array, Array, Array]:
    w, c, v, b = np.split(theta, np.cumsum([UNITS * k, UNITS, UNITS]))
    return w.reshape(UNITS, k), c, v, b


def _slopes(theta: Array, x: Array, hidden: Array) -> Array:
    """∂y/∂θ, (N, size)."""
    v = _parts(theta, x.shape[1])[2]
    bent = (1 - hidden**2) * v
    deep = (bent[:, :, None] * x[:, None, :]).reshape(len(x), -1)
    return np.concatenate([deep, bent, hidden, np.ones((len(x), 1))], axis=1)


def _descend(theta: Array, x: Array, target: Array, decay: float) -> Array:
    """Levenberg–Marquardt from θ; a silent target has the zero net."""
    size = float(np.mean(target**2))
    if size == 0:
        return np.zeros_like(theta)
    shrink = decay * size * len(x)

    def loss(at: Array) -> tuple[float, Array, Array]:
        y, hidden = _forward(at, x)
        rest = y - target
        return float(rest @ rest + shrink * (at @ at)), rest, hidden

    damping = 1e-2
    now, rest, hidden = loss(theta)
    for _ in range(STEPS):
        slopes = _slopes(theta, x, hidden)
        gram = slopes.T @ slopes + shrink * np.eye(theta.size)
        gradient = slopes.T @ rest + shrink * theta
        step = np.linalg.solve(gram + damping * np.diag(np.diag(gram)), -gradient)
        after = loss(theta + step)
        if after[0] < now:
            fall = (now - after[0]) / now
            theta, damping = theta + step, damping / 5
            now, rest, hidden = after
            if fall < _FLAT:
                break
        else:
            damping *= 4
            if damping > 1e10:
                break
    return theta
