"""Target of a campaign: which standard deviation must fall below which value.

| target | standard deviation of |
|---|---|
| `v=5mNm` | the torque of motions never seen, all joints together [N·m]; mN or N where all slide |
| `a=1.5%` | the base parameters over their sizes, root mean square |
| `payload=5g` | the mass of a payload that the last motion carries on the identified arm |
"""

import re
from dataclasses import dataclass

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.uncertainty import Uncertainty
from runtime.excitation.motion.trajectory import Trajectory
from runtime.excitation.search.criteria import sizes, unseen_joints
from runtime.excitation.search.information import information
from runtime.excitation.search.measures import covariance
from runtime.excitation.search.prediction import covariance_of, payload_sigma
from runtime.identification.identified import Identification
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS
from runtime.recording.friction.columns import OFFSET

UNITS = {
    "v": {"mNm": 1e-3, "Nm": 1.0, "mN": 1e-3, "N": 1.0},
    "a": {"%": 0.01},
    "payload": {"g": 1e-3, "kg": 1.0},
}
"""Kind of target → unit → its size in SI units."""
_FORM = re.compile(r"(?P<kind>[a-z]+)=?(?P<number>[0-9.]+(e-?[0-9]+)?)(?P<unit>[A-Za-z%]+)")


@dataclass(frozen=True, slots=True)
class Target:
    """A target."""

    text: str  # as the user stated it
    kind: str  # "v", "a" or "payload"
    value: float  # largest standard deviation [N·m, 1, kg]
    unit: str  # of the text

    def shown(self, value: float) -> str:
        """A standard deviation in the unit of the target."""
        return f"{value / UNITS[self.kind][self.unit]:.3g} {self.unit}"


def target_of(text: str) -> Target:
    """Target from its text."""
    match = _FORM.fullmatch(text.replace(" ", ""))
    if match and match["unit"] in UNITS.get(match["kind"], {}):
        value = float(match["number"]) * UNITS[match["kind"]][match["unit"]]
        if value > 0:
            return Target(text, match["kind"], value, match["unit"])
    raise IdentificationError(
        f"expected a target such as v=5mNm, a=1.5% or payload=5g, got '{text:.40}'; correct it"
    )


def reached(target: Target, result: Identification, motion: Trajectory) -> float:
    """Standard deviation of the quantity of a target, by the posterior of a result."""
    lib, spread = result.lib, base_covariance(result)
    if target.kind == "v":
        seen = np.sum(unseen_joints(lib, motion.home), axis=0)
        return float(np.sqrt(np.sum(seen * spread)))
    if target.kind == "a":
        size = sizes(lib, information(lib))
        return float(np.sqrt(np.mean(np.diag(spread) / size**2)))
    # The error of the arm counts: information Tᵀ (G⁻¹ + C)⁻¹ T of the payload, with
    # G the information of this motion, C the covariance of β, T the columns of K of the last link.
    noise, rate = torque_noise(result)
    of_motion = covariance_of(lib, motion, information(lib, noise, rate), (OFFSET.name,))
    columns = lib.base_matrix[:, -N_PARAMETERS:]
    ten = covariance(columns.T @ np.linalg.solve(of_motion + spread, columns))
    if ten is None:
        raise IdentificationError(
            f"a payload is not identifiable on '{lib.name}' by this motion; state v or a as target"
        )
    return payload_sigma(ten)[0]


def base_covariance(result: Identification) -> Array:
    """Covariance of β, (n_b, n_b), with the error of the estimate."""
    root = result.lib.base_matrix @ _uncertainty(result).root
    return np.asarray(root @ root.T)


def _uncertainty(result: Identification) -> Uncertainty:
    if result.uncertainty is None:
        raise IdentificationError(
            f"expected a method with an uncertainty, got '{result.method}'; identify with map"
        )
    return result.uncertainty


def torque_noise(result: Identification) -> tuple[Array, float]:
    """σ (n,) of independent noise that stands for coloured residuals, and the rate of the rows."""
    uncertainty = _uncertainty(result)
    return uncertainty.noise * np.sqrt(max(uncertainty.inflation, 1.0)), result.train.rate_hz


def known_before(result: Identification, lib: Library) -> Array:
    """Information G₀ over β of all logs and the prior of a result."""
    spread = base_covariance(result)
    floor = 1e-12 * np.trace(spread) / len(spread)  # β that the data fix to rounding
    inverse = np.linalg.inv(spread + floor * np.eye(len(lib.base_columns)))
    return np.asarray((inverse + inverse.T) / 2)
