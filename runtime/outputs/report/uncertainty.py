"""Uncertainty of a result in the report: σ per link, residuals per joint."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from runtime.library.parameters import PI_NAMES
from runtime.outputs.report.page import ReportTable, Section

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LinkUncertainty:
    """Uncertainty of one link.

    Attributes:
        mass_sigma: standard deviation of the mass [kg].
        com_sigma: (3,) standard deviations of the centre of mass [m]; None where undefined.
        verdicts: one per parameter: identified, prior-dominated or unobservable.
    """

    mass_sigma: float
    com_sigma: Array | None
    verdicts: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ResultUncertainty:
    """Uncertainty of a result.

    Attributes:
        advice: one sentence.
        n_eff: effective sample size.
        inflation: factor by which autocorrelation raises the variances.
        boundary: whether a link is close to the limit of physical consistency.
        links: one per link.
        noise: (n,) residual RMS [N·m, N].
        model_band: (n,) σ of the torque due to uncertain parameters [N·m, N].
        white: (n,) share of lags at which the autocorrelation is that of white noise.
        gain_limits: (n,) relative error of a torque gain that the log shows; empty where unknown.
    """

    advice: str
    n_eff: float
    inflation: float
    boundary: bool
    links: tuple[LinkUncertainty, ...]
    noise: Array
    model_band: Array
    white: Array
    gain_limits: tuple[float | None, ...] = ()


def read_uncertainty(
    raw: Mapping[str, Any] | None, joints: int, links: int
) -> ResultUncertainty | None:
    """Read the entry `uncertainty` of result.json."""
    if not raw:
        return None
    noise, band, white = (
        np.array(raw[key], dtype=float) for key in ("noise", "model_band", "white")
    )
    if any(a.shape != (joints,) for a in (noise, band, white)) or len(raw["links"]) != links:
        raise ValueError(
            f"'uncertainty': expected {joints} joints and {links} links, got other lengths"
        )
    return ResultUncertainty(
        str(raw["advice"]),
        float(raw["n_eff"]),
        float(raw["inflation"]),
        bool(raw["boundary"]),
        tuple(_link(entry) for entry in raw["links"]),
        noise,
        band,
        white,
        _limits(raw.get("gain_limits") or [], joints),
    )


def _limits(raw: list[float | None], joints: int) -> tuple[float | None, ...]:
    if len(raw) not in (0, joints):
        raise ValueError(f"'uncertainty': expected {joints} gain_limits, got {len(raw)}")
    return tuple(None if x is None else float(x) for x in raw)


def _percent(share: float | None) -> str:
    return "any" if share is None else f"{100 * share:.2g}\N{NO-BREAK SPACE}%"


def _link(raw: Mapping[str, Any]) -> LinkUncertainty:
    com = raw["com_sigma"]
    spread = None if com is None else np.array(com, dtype=float)
    if spread is not None and spread.shape != (3,):
        raise ValueError("com_sigma, expected three numbers")
    verdicts = tuple(map(str, raw["verdicts"]))
    if len(verdicts) != len(PI_NAMES):
        raise ValueError(f"verdicts, expected {len(PI_NAMES)} words per link")
    return LinkUncertainty(float(raw["mass_sigma"]), spread, verdicts)


def _named(verdicts: tuple[str, ...], word: str) -> str:
    """Names of the parameters with a verdict."""
    names = [name for name, each in zip(PI_NAMES, verdicts, strict=True) if each == word]
    return " ".join(names) or "–"


def uncertainty_sections(
    s: ResultUncertainty, joints: tuple[str, ...], links: tuple[str, ...]
) -> tuple[Section, ...]:
    """Tables of the σ of the links and of the residuals."""
    words = ("identified", "prior-dominated", "unobservable")
    of_links = tuple(
        (
            name,
            f"{link.mass_sigma:.3g}",
            "–" if link.com_sigma is None else f"{1e3 * float(np.max(link.com_sigma)):.2g}",
            *(_named(link.verdicts, word) for word in words),
        )
        for name, link in zip(links, s.links, strict=True)
    )
    of_joints = tuple(
        (
            joint,
            f"{noise:.3g}",
            f"{band:.2g}",
            f"{100 * white:.0f}\N{NO-BREAK SPACE}%",
            *((_percent(s.gain_limits[k]),) if s.gain_limits else ()),
        )
        for k, (joint, noise, band, white) in enumerate(
            zip(joints, s.noise, s.model_band, s.white, strict=True)
        )
    )
    heads: tuple[str, ...] = (
        "joint",
        "residual RMS",
        "model σ",
        "lags within the white-noise band",
    )
    hidden = ""
    if s.gain_limits:
        heads = (*heads, "gain error that may go unnoticed")
        hidden = (
            " Last column: a torque gain that is wrong by up to this share, relative to the other "
            "joints, may leave no trace in such a log."
        )
    edge = " A link is close to the limit of physical consistency." if s.boundary else ""
    return (
        Section(
            "Uncertainty of the links",
            f"{s.advice[:1].upper()}{s.advice[1:]}.{edge} σ is computed with the URDF as "
            "prior. A parameter is identified where the data reduce its prior variance at least "
            "tenfold: its interval is that of the log. Prior-dominated parameters keep the value "
            "and uncertainty of the URDF, and unobservable ones have no effect on the torque.",
            ReportTable(("link", "σ mass [kg]", "σ CoM [mm]", *words), of_links),
        ),
        Section(
            "Residuals",
            f"Effective sample size of the training residuals: {s.n_eff:.0f} (variance inflation "
            f"{s.inflation:.1f}). Model σ: standard deviation of the torque due to uncertain "
            f"parameters.{hidden}",
            ReportTable(heads, of_joints),
        ),
    )
