"""Standard deviations and 95 % intervals of friction coefficients and stiffnesses of springs.

To second order [π; φ] is normal. With the best φ at π, U φ = t − O π, and the root L_π of the
covariance of π (`posterior_file`) a root of the covariance of φ is

    L_φ = [−U⁻¹ O L_π, √S U⁻¹, φ − U⁻¹ (t − O π)]

The last column is what the estimate differs from the best φ at its π, as in methods with other
weights. L_π contains nuisance torque, errors of torque gains, and the delay and encoder biases that
are estimated. A coefficient without an interval of this kind has NaN: its column is zero or a
combination of other friction columns, it is held at the bound 0, or learned friction shares its
torque.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from runtime.estimators.regression.posterior import posterior_of
from runtime.estimators.regression.samples import NORMAL_95
from runtime.identification.identified import Identification
from runtime.identification.posterior_file import posterior_of_result
from runtime.identification.result_record import FrictionPart
from runtime.library import Array
from runtime.recording.friction import names_where
from runtime.recording.settings import SPRING


def friction_root(result: Identification) -> Array | None:
    """Root of the covariance of `result.usual_phi`, (n k, ·); None without a posterior."""
    posterior, phi = posterior_of_result(result), result.usual_phi
    if posterior is None or result.learned is not None or not phi.size:
        return None
    _, system = posterior.reduced(result.lib)
    if system.lengths.size != result.phi.size:
        return None
    difference = result.phi.ravel() - system.phi(result.pi)
    root = np.column_stack([posterior.phi_over(system), posterior.phi_root(system), difference])
    statistics = posterior.information.statistics
    columns = statistics.factor[:, statistics.n_base :]
    root[~determined(columns)] = np.nan
    root = posterior.usual(root)
    root[_held_at_zero(result, phi).ravel()] = np.nan
    return root


def friction_sigma(result: Identification) -> Array | None:
    """Standard deviations of `result.usual_phi`."""
    root, shape = friction_root(result), result.usual_phi.shape
    return None if root is None else np.linalg.norm(root, axis=1).reshape(shape)


def friction_covariance(result: Identification) -> Array | None:
    """Covariance of the coefficients of every joint, (n, k, k); NaN where not determined."""
    root = friction_root(result)
    if root is None:
        return None
    joints = root.reshape(*result.usual_phi.shape, -1)
    return np.asarray(joints @ np.swapaxes(joints, 1, 2))


def friction_intervals(result: Identification) -> tuple[Any, Any]:
    """`sigma` and `interval_95` of the friction in result.json; None without a posterior."""
    sigma = friction_sigma(result)
    if sigma is None:
        return None, None
    ends = [result.usual_phi + side * NORMAL_95 * sigma for side in (-1, 1)]
    is_known = np.isfinite(sigma).tolist()
    return (
        tuple(
            tuple(value if known else None for value, known in zip(*row, strict=True))
            for row in zip(sigma.tolist(), is_known, strict=True)
        ),
        tuple(
            tuple((low, high) if known else None for low, high, known in zip(*row, strict=True))
            for row in zip(ends[0].tolist(), ends[1].tolist(), is_known, strict=True)
        ),
    )


def spring_lines(friction: FrictionPart | None) -> list[str]:
    """One line per spring of unknown stiffness: its constant with the 95 % interval."""
    lines: list[str] = []
    if friction is None:
        return lines
    for place, column in enumerate(friction.columns):
        if column.startswith(SPRING):
            value, ends = friction.values[0][place], friction.interval_95
            pair = ends and ends[0][place]
            spread = (
                f", 95 % interval {pair[0]:.5g} to {pair[1]:.5g}" if pair else ", without interval"
            )
            lines.append(
                f"spring {column.removeprefix(SPRING)}: stiffness {value:.5g}{spread} (SI units)"
            )
    return lines


def determined(columns: Array) -> NDArray[np.bool_]:
    """Whether each column (rows, m) is neither zero nor in a combination that is zero, (m,)."""
    return columns.any(axis=0) & np.isfinite(posterior_of(columns).sigma)


def _held_at_zero(result: Identification, phi: Array) -> NDArray[np.bool_]:
    """Whether each coefficient (n, k) is at the bound 0 of friction that cannot drive a joint."""
    bounded = names_where(lambda column: column.is_nonnegative)
    names = result.friction.columns
    return np.array([name in bounded for name in names], dtype=bool) & (phi == 0)
