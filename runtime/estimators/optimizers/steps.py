"""Optimisers for the loop: Adam and Levenberg–Marquardt.

Adam (Kingma & Ba 2015): m, v ← moving averages of g, g²; x ← x − η m̂ / (√v̂ + ε).
Source: document Eqs. 4.42–4.46; ε stands outside the square root.

Levenberg–Marquardt: minimise L(x) = (‖r(x)‖² + ρ) · scale by damped Gauss–Newton steps.
(JᵀJ + μI) δ = −Jᵀr is solved as δ = −Jᵀ (JJᵀ + μI)⁻¹ r, which is smaller where x has more entries
than r has, as λ does. μ follows the gain ratio of Madsen, Nielsen & Tingleff, *Methods for
non-linear least squares problems*, 2004, algorithm 3.16.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from runtime.estimators.optimizers.loop import Array, Status

_LARGEST_DAMPING = 1e200
"""μ beyond which no step is tried any more."""


@dataclass(frozen=True, slots=True)
class AdamOptions:
    """η, β₁, β₂, ε; a data class, whose names are keys of saved settings."""

    learning_rate: float = 1e-3
    beta1: float = 0.9
    beta2: float = 0.999
    epsilon: float = 1e-8


@dataclass(frozen=True, slots=True)
class AdamState:
    """First and second moment and the number of steps taken."""

    m: Array
    v: Array
    step: int


@dataclass(frozen=True, slots=True)
class AdamIterate:
    """A point, the loss of the point before it, and the moments.

    Attributes:
        x: (size,).
        loss: of the point that the last step began with; NaN before the first step.
        moments: first and second moment.
    """

    x: Array
    loss: float
    moments: AdamState

    @property
    def is_new(self) -> bool:
        """Adam accepts every step."""
        return True


@dataclass(frozen=True, slots=True)
class Adam:
    """Adam as an `Optimiser`.

    Attributes:
        value_gradient: loss and gradient (size,) at x; it may draw a mini-batch at each call.
        options: step size and decay of the moments.
    """

    value_gradient: Callable[[Array], tuple[float, Array]]
    options: AdamOptions

    def init(self, x: Array) -> AdamIterate:
        """Zero moments at the first point, (size,)."""
        return AdamIterate(np.array(x, dtype=float), np.nan, adam_start(x.size))

    def step(self, state: AdamIterate) -> AdamIterate:
        """One step along the moments of the gradient at the present point."""
        loss, gradient = self.value_gradient(state.x)
        moments, x = adam_step(state.moments, state.x, gradient, self.options)
        return AdamIterate(x, loss, moments)

    def status(self, state: AdamIterate) -> Status | None:
        """None: a stochastic gradient shows no end; validation does."""
        del state
        return None


def adam_start(size: int) -> AdamState:
    """Zero moments of `size` unknowns."""
    return AdamState(np.zeros(size), np.zeros(size), 0)


def adam_step(
    state: AdamState, x: Array, gradient: Array, options: AdamOptions
) -> tuple[AdamState, Array]:
    """Moments and point after one step.

    Args:
        state: moments before the step.
        x: point before the step, (size,).
        gradient: of the loss at x, (size,).
        options: step size and decay of the moments.

    Returns:
        The moments and the point after the step.
    """
    step = state.step + 1
    m = options.beta1 * state.m + (1 - options.beta1) * gradient
    v = options.beta2 * state.v + (1 - options.beta2) * gradient**2
    # The moments start at zero; dividing by 1 − βᵏ removes that bias.
    m_hat = m / (1 - options.beta1**step)
    v_hat = v / (1 - options.beta2**step)
    moved = x - options.learning_rate * m_hat / (np.sqrt(v_hat) + options.epsilon)
    return AdamState(m, v, step), moved


@dataclass(frozen=True, slots=True)
class LevenbergOptions:
    """Settings of the descent.

    Attributes:
        max_iterations: steps tried, accepted or not.
        first_damping: μ at the start, relative to the largest squared column of J.
        step_tolerance: stop when ‖δ‖ falls below this fraction of ‖x‖.
        decrease_tolerance: stop when a step lowers L by less than this fraction, as predicted.
    """

    max_iterations: int = 200
    first_damping: float = 1e-8
    step_tolerance: float = 1e-12
    decrease_tolerance: float = 1e-12


@dataclass(frozen=True, slots=True)
class LevenbergState:
    """A point with its residual and damping.

    Attributes:
        x: (size,).
        residual: r, (m,).
        jacobian: J = ∂r/∂x, (m, size).
        loss: L.
        damping: μ of the next step.
        growth: factor on μ where the next step is rejected.
        ended: why to stop; None to go on.
        is_new: whether the last step was accepted.
    """

    x: Array
    residual: Array
    jacobian: Array
    loss: float
    damping: float
    growth: float = 2.0
    ended: Status | None = None
    is_new: bool = False


@dataclass(frozen=True, slots=True)
class LevenbergMarquardt:
    """Levenberg–Marquardt as an `Optimiser`.

    Attributes:
        residual_jacobian: r (m,) and J (m, size) at x.
        options: damping and tolerances.
        rest: ρ.
        scale: factor of the loss.
    """

    residual_jacobian: Callable[[Array], tuple[Array, Array]]
    options: LevenbergOptions
    rest: float = 0.0
    scale: float = 0.5

    def init(self, x: Array) -> LevenbergState:
        """First point, (size,), with a damping relative to the largest column of J."""
        residual, jacobian = self.residual_jacobian(x)
        loss = self._loss(residual)
        damping = self.options.first_damping * float(np.max(np.sum(jacobian**2, axis=0)))
        ended = None if np.isfinite(loss) else Status.DIVERGED
        return LevenbergState(
            np.array(x, dtype=float), residual, jacobian, loss, damping, ended=ended
        )

    def step(self, state: LevenbergState) -> LevenbergState:
        """Try one step; a rejected one changes the damping only."""
        x, residual, jacobian = state.x, state.residual, state.jacobian
        # δ = −Jᵀ (JJᵀ + μI)⁻¹ r by a Cholesky factor of JJᵀ + μI.
        normal = jacobian @ jacobian.T + state.damping * np.eye(len(residual))
        try:
            factor = np.linalg.cholesky(normal)
        except np.linalg.LinAlgError:
            return _rejected(state)
        step = -jacobian.T @ np.linalg.solve(factor.T, np.linalg.solve(factor, residual))
        tolerance = self.options.step_tolerance
        if np.linalg.norm(step) <= tolerance * (np.linalg.norm(x) + tolerance):
            return replace(state, ended=Status.CONVERGED, is_new=False)
        # Decrease that the linear model of r predicts, and the one that comes.
        predicted = float(step @ (state.damping * step - jacobian.T @ residual)) * self.scale
        new_residual, new_jacobian = self.residual_jacobian(x + step)
        loss = self._loss(new_residual)
        if not (loss < state.loss and predicted > 0):
            return _rejected(state)
        # Their ratio near one: the model holds, μ falls by up to 3; near zero: μ grows.
        gain, decrease = (state.loss - loss) / predicted, state.loss - loss
        flat = max(decrease, predicted) <= self.options.decrease_tolerance * state.loss
        return LevenbergState(
            x + step,
            new_residual,
            new_jacobian,
            loss,
            state.damping * max(1 / 3, 1 - (2 * gain - 1) ** 3),
            ended=Status.CONVERGED if flat else None,
            is_new=True,
        )

    def status(self, state: LevenbergState) -> Status | None:
        """Why to stop; None to go on."""
        return state.ended

    def _loss(self, residual: Array) -> float:
        return float(residual @ residual + self.rest) * self.scale


def _rejected(state: LevenbergState) -> LevenbergState:
    """The same point with more damping; STALLED where no damping helps."""
    damping = state.damping * state.growth
    ended = None if damping < _LARGEST_DAMPING else Status.STALLED
    return replace(state, damping=damping, growth=state.growth * 2, ended=ended, is_new=False)
