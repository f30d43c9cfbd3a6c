"""An identified payload with its uncertainty, as `estimate` returns it."""

from dataclasses import dataclass

from runtime.identification.payload.body import NAMES, Body
from runtime.identification.payload.mount import Mount
from runtime.library import Array
from runtime.recording.notebook import html_table


@dataclass(frozen=True, slots=True)
class Payload:
    """An identified payload with its uncertainty.

    Attributes:
        mount: link and frame.
        pi: parameters in the link's frame, (10,) [kg, kg·m ×3, kg·m² ×6].
        covariance: of π for N_eff samples, (10, 10).
        body: mass, centre of mass and inertia in the mount's frame, covariance for N_eff samples.
        white: the same body with the covariance for white noise.
        offsets: b, (n,) N·m or N.
        noise: σ_j, (n,) N·m or N.
        n_samples: N.
        n_effective: N_eff.
        differential: True when a run without the payload was subtracted.
        prior_dominated: names of values that the prior determines rather than the data.
        arm: origin of the arm's model.
        status: one sentence.
        notes: sentences of advice.
        gain_error: standard deviation of the torque gains that the covariances include.
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
    gain_error: float

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
