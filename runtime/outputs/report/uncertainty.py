"""How sure a result is, as the report tells it: what the data say per link, residuals per joint."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from runtime.outputs.report.layout import ReportTable, Section

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LinkUncertainty:
    """σ of a link's mass [kg] and centre of mass (3,) [m], and its parameters by verdict."""

    mass_sigma: float
    com_sigma: Array | None
    verdicts: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ResultUncertainty:
    """What result.json says of uncertainty.

    Attributes:
        noise, model_band, white: per joint: residual RMS, σ of the model's torque, and the share
            of lags that a white residual could have.
    """

    advice: str
    n_eff: float
    inflation: float
    boundary: bool
    links: tuple[LinkUncertainty, ...]
    noise: Array
    model_band: Array
    white: Array


def read_uncertainty(
    raw: Mapping[str, Any] | None, joints: int, links: int
) -> ResultUncertainty | None:
    """The entry `uncertainty`; None in results without it.

    Raises:
        ValueError: shapes that do not fit.
    """
    if not raw:
        return None
    per_joint = [np.array(raw[key], dtype=float) for key in ("noise", "model_band", "white")]
    if any(a.shape != (joints,) for a in per_joint) or len(raw["links"]) != links:
        raise ValueError("'uncertainty': its lists do not have one entry per joint or link")
    return ResultUncertainty(
        str(raw["advice"]),
        float(raw["n_eff"]),
        float(raw["inflation"]),
        bool(raw["boundary"]),
        tuple(_link(entry) for entry in raw["links"]),
        *per_joint,
    )


def _link(raw: Mapping[str, Any]) -> LinkUncertainty:
    com = raw["com_sigma"]
    spread = None if com is None else np.array(com, dtype=float)
    return LinkUncertainty(float(raw["mass_sigma"]), spread, tuple(map(str, raw["verdicts"])))


def uncertainty_sections(s: ResultUncertainty, joints: tuple[str, ...]) -> tuple[Section, ...]:
    """Two tables: what is known of the links, and how the residual looks."""
    words = ("identified", "prior-dominated", "unobservable")
    known = tuple(
        (
            f"link of {joint}",
            f"{link.mass_sigma:.3g}",
            "–" if link.com_sigma is None else f"{1e3 * float(np.max(link.com_sigma)):.2g}",
            *(str(link.verdicts.count(word)) for word in words),
        )
        for joint, link in zip(joints, s.links, strict=True)
    )
    rest = tuple(
        (joint, f"{noise:.3g}", f"{band:.2g}", f"{100 * white:.0f}\N{NO-BREAK SPACE}%")
        for joint, noise, band, white in zip(joints, s.noise, s.model_band, s.white, strict=True)
    )
    edge = " A link lies on the boundary of consistency." if s.boundary else ""
    return (
        Section(
            "What the data determine",
            f"{s.advice[:1].upper()}{s.advice[1:]}.{edge} σ with the URDF as a prior; a parameter "
            "is identified when the data shrink its variance tenfold.",
            ReportTable(("link", "σ mass [kg]", "σ CoM [mm]", *words), known),
        ),
        Section(
            "Residuals",
            f"The training samples are worth {s.n_eff:.0f} independent ones (variance inflation "
            f"{s.inflation:.1f}). Model σ is what uncertain parameters add to a torque.",
            ReportTable(("joint", "residual RMS", "model σ", "lags like white noise"), rest),
        ),
    )
