"""Uncertainty of a result in the report: σ per link, residuals per joint."""

import numpy as np

from runtime.common.tables import Table, significant
from runtime.common.terminal import as_typed
from runtime.identification.result_record import UncertaintyPart
from runtime.library.parameters import PI_NAMES
from runtime.outputs.report.page import Section


def _percent(share: float | None) -> str:
    return (
        "any" if share is None or share >= 1 else f"{significant(100 * share)}\N{NO-BREAK SPACE}%"
    )


def _named(verdicts: tuple[str, ...], word: str) -> str:
    """Names of the parameters with a verdict."""
    names = [name for name, each in zip(PI_NAMES, verdicts, strict=True) if each == word]
    return " ".join(names) or "–"


def uncertainty_sections(
    s: UncertaintyPart, joints: tuple[str, ...], links: tuple[str, ...]
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
            *((_percent(s.detectable_gain_error[k]),) if s.detectable_gain_error else ()),
        )
        for k, (joint, noise, band, white) in enumerate(
            zip(joints if s.noise else (), s.noise, s.model_band, s.white_lag_share, strict=True)
        )
    )
    heads: tuple[str, ...] = (
        "joint",
        "residual RMS",
        "model σ",
        "lags within the white-noise band",
    )
    hidden = ""
    if s.detectable_gain_error:
        heads = (*heads, "gain error that may go unnoticed")
        hidden = (
            " Last column: a torque gain that is wrong by up to this share, relative to the other "
            "joints, may leave no trace in such a log."
        )
    advice = as_typed(s.advice)
    edge = " A link is close to the limit of physical consistency." if s.boundary else ""
    sections = (
        Section(
            "Uncertainty of the links",
            f"{advice[:1].upper()}{advice[1:]}.{edge} σ is computed with the URDF as "
            "prior. A parameter is identified where the data reduce its prior variance at least "
            "tenfold: its interval is that of the log. Prior-dominated parameters keep the value "
            "and uncertainty of the URDF, and unobservable ones have no effect on the torque.",
            Table(("link", "σ mass [kg]", "σ CoM [mm]", *words), of_links),
        ),
        Section(
            "Residuals",
            f"Effective sample size of the training residuals: {s.n_eff:.0f} (variance inflation "
            f"{s.inflation:.1f}). Model σ: standard deviation of the torque due to uncertain "
            f"parameters.{hidden}",
            Table(heads, of_joints),
        ),
    )
    return sections if s.noise else sections[:1]
