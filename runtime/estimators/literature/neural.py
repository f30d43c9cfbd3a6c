"""Friction by linear columns and a small net of them, in turn with the rigid body.

The net of a joint, trained in NumPy on τ − Y π − F φ, is

    y_j(x) = b + Σ_h v_h tanh(W_h x + c_h),   4 units, x the friction columns of the joint, scaled

min Σ (y − target)²/s² + α N ‖θ‖² by Levenberg–Marquardt; α is chosen on validation samples, and no
net at all is one of the choices. Inputs are the joint's own motion only: torque or position as
input would learn one run by heart. Source: the idea of Hu, Xiong et al.
"""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from runtime.errors import NeedsError
from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.methods import Method
from runtime.estimators.problem import Fit, Problem
from runtime.estimators.regression.samples import Samples
from runtime.library import Array

UNITS = 4
DECAYS = (1e-4, 1e-3, 1e-2)  # candidates of α; validation chooses among them
STEPS = 60  # limit of steps per net, accepted or not
_FLAT = 1e-6  # relative decrease of the loss below which training stops
_FIRST_DAMPING, _LARGEST_DAMPING = 1e-2, 1e10  # first and last damping over diag(JᵀJ)
ROUNDS = 2
INPUTS = ("viscous", "coulomb", "dahl")  # friction columns that are inputs of the nets by default


@dataclass(frozen=True, slots=True)
class FrictionNet:
    """Nets of all joints."""

    theta: Array  # (n, UNITS (k + 2) + 1), per joint [W, c, v, b]
    scale: Array  # RMS of the k inputs, (n, k)

    @classmethod
    def from_facts(cls, facts: dict[str, Any]) -> Self:
        """Nets of a result file."""
        theta, scale = (np.array(facts[key], dtype=float) for key in ("theta", "scale"))
        n, k = scale.shape
        fits = theta.shape == (n, UNITS * (k + 2) + 1) and np.isfinite(theta).all()
        if not fits or not ((scale > 0) & np.isfinite(scale)).all():
            raise ValueError("theta and scale do not fit together")
        return cls(theta, scale)

    def facts(self) -> dict[str, Any]:
        """Numbers of the nets, JSON-ready."""
        return {"theta": self.theta.tolist(), "scale": self.scale.tolist()}

    def __call__(self, columns: Array) -> Array:
        """Friction torque (N, n), N·m, from friction columns (N, n, k)."""
        inputs = [columns[:, j] / scale for j, scale in enumerate(self.scale)]
        return np.stack([y for y, _ in map(_forward, self.theta, inputs)], axis=1)


def train(
    columns: Array,
    target: Array,
    validation_columns: Array,
    validation_target: Array,
    rng: np.random.Generator,
) -> FrictionNet:
    """Train a net per joint and decay, and keep the one with the least validation error."""
    n, k = columns.shape[1:]
    scale = np.sqrt(np.mean(columns**2, axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    theta = np.zeros((n, UNITS * (k + 2) + 1))
    for j in range(n):
        x, unseen = columns[:, j] / scale[j], validation_columns[:, j] / scale[j]
        best = float(np.mean(validation_target[:, j] ** 2))
        start = rng.normal(size=theta.shape[1]) / np.sqrt(k)
        for decay in DECAYS:
            trained = _trained(start, x, target[:, j], decay)
            error = float(np.mean((_forward(trained, unseen)[0] - validation_target[:, j]) ** 2))
            if error < best:
                best, theta[j] = error, trained
    return FrictionNet(theta, scale)


def _forward(theta: Array, x: Array) -> tuple[Array, Array]:
    """y (N,) and the activations (N, UNITS)."""
    w, c, v, b = _parts(theta, x.shape[1])
    hidden = np.tanh(x @ w.T + c)
    return hidden @ v + b, hidden


def _parts(theta: Array, k: int) -> tuple[Array, Array, Array, Array]:
    """W (UNITS, k), c, v (UNITS,) and b (1,) of θ."""
    w, c, v, b = np.split(theta, np.cumsum([UNITS * k, UNITS, UNITS]))
    return w.reshape(UNITS, k), c, v, b


def _slopes(theta: Array, x: Array, hidden: Array) -> Array:
    """∂y/∂θ, (N, size)."""
    bent = (1 - hidden**2) * _parts(theta, x.shape[1])[2]
    deep = (bent[:, :, None] * x[:, None, :]).reshape(len(x), -1)
    return np.concatenate([deep, bent, hidden, np.ones((len(x), 1))], axis=1)


def _trained(theta: Array, x: Array, target: Array, decay: float) -> Array:
    """θ after the descent with Marquardt's scaling, (G + μ diag G) δ = −g; 0 for target 0."""
    size = float(np.mean(target**2))
    if size == 0:
        return np.zeros_like(theta)
    shrink = decay * size * len(x)  # weight of ‖θ‖² in the loss

    def loss_at(theta: Array) -> tuple[float, Array, Array]:
        """Loss, residual (N,) and activations (N, UNITS)."""
        y, hidden = _forward(theta, x)
        rest = y - target
        return float(rest @ rest + shrink * (theta @ theta)), rest, hidden

    (loss, rest, hidden), damping = loss_at(theta), _FIRST_DAMPING
    for _ in range(STEPS):
        slopes = _slopes(theta, x, hidden)
        gram = slopes.T @ slopes + shrink * np.eye(theta.size)
        gradient = slopes.T @ rest + shrink * theta
        moved = theta + np.linalg.solve(gram + damping * np.diag(np.diag(gram)), -gradient)
        tried = loss_at(moved)
        if tried[0] < loss:
            is_flat = (loss - tried[0]) / loss < _FLAT
            theta, (loss, rest, hidden), damping = moved, tried, damping / 5
        else:  # a rejected step raises the damping only
            damping *= 4
            is_flat = damping > _LARGEST_DAMPING
        if is_flat:
            break
    return theta


def fit_neural(problem: Problem) -> Fit:
    """Identify π and φ by the most probable consistent model, and the rest of friction by nets."""
    if not problem.train.columns.shape[2]:
        raise NeedsError(
            "the method nn needs friction columns as inputs of its nets, got none; name some, for "
            f"example --friction {','.join(INPUTS)}"
        )
    unseen, data = problem.validation, problem.train
    fit = fit_map(problem)
    for round_ in range(ROUNDS):
        rng = np.random.default_rng([problem.seed, round_])
        target, held = _rest(problem, data, fit), _rest(problem, unseen, fit)
        net = train(data.columns, target, unseen.columns, held, rng)
        rest = replace(data, tau=data.tau - net(data.columns))
        fit = fit_map(replace(problem, train=rest))
    learned = int(np.sum(np.any(net.theta, axis=1)))
    left = _rest(problem, unseen, fit) - net(unseen.columns)
    status = (
        f"{ROUNDS} rounds; nets for {learned} of {problem.lib.n_joints} joints, which leave "
        f"{np.sqrt(np.mean(left**2)):.3g} N·m of the validation torque"
    )
    none = ("linear friction predicts the validation data best: no net is kept",)
    notes = () if learned else none
    return replace(fit, status=status, iterations=ROUNDS, optimum=None, learned=net, notes=notes)


def _rest(problem: Problem, samples: Samples, fit: Fit) -> Array:
    return samples.tau - samples.rigid(problem.lib, fit.pi) - samples.friction(fit.phi)


NEURAL = Method(
    "nn",
    "consistent, with a small net per joint for the friction that linear columns leave over",
    fit_neural,
    label="neural",
    default_columns=INPUTS,
    uses_validation=True,
    learned=FrictionNet.from_facts,
    when_recommended="the log contains friction that linear columns do not describe; try "
    "--friction auto, too",
)
