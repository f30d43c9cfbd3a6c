"""The option --until of `symgen excite`: the shortest session that promises an accuracy."""

from typing import Annotated, Any

import typer

from runtime.cli.approach_options import SessionPlan
from runtime.cli.given_options import given_options
from runtime.errors import RuntimeFault
from runtime.excitation import Design, DesignSettings, Information, Trajectory, design
from runtime.identification.expected_accuracy.session_error import ModelError
from runtime.library import Library

Until = Annotated[
    str | None,
    typer.Option(
        metavar="TARGET",
        help='Find the shortest session that promises a standard deviation: "payload 5 g", '
        "v=100mNm (torque of motions never seen) or a=10% (base parameters over their sizes). It "
        "counts noise, friction, offsets, gains and model error. --duration and --criterion "
        "follow.",
    ),
]
GainError = Annotated[
    float,
    typer.Option(
        metavar="SHARE",
        help="Standard deviation of the torque gain of every joint in --until, relative to one.",
    ),
]
_FOLLOWING = {
    "duration",
    "criterion",
    "document",
    "static",
    "payload_only",
    "noise_model",
    "cutoff",
}
"""Parameters that --until chooses."""


def require_gain_error(gain_error: float) -> None:
    """Check a value of --gain-error."""
    if not 0 <= gain_error < 1:
        raise RuntimeFault(f"--gain-error is a share of one, such as 0.005, got {gain_error:g}")


def until_kind(context: typer.Context, until: str | None) -> str | None:
    """Kind of the target of --until."""
    given = given_options(context)
    if until is None:
        if "gain_error" in given:
            raise RuntimeFault(
                "--gain-error is part of the accuracy of --until; give --until, or leave it out"
            )
        return None
    for name, option in given.items():
        if name in _FOLLOWING:
            raise RuntimeFault(f"--until chooses the motion by its target; leave out {option}")
    from runtime.campaign.target import target_of

    return target_of(until).kind


def criterion_and_unknowns(
    criterion: str | None, document: bool, payload_only: bool, aim: str | None
) -> tuple[str, bool]:
    """Criterion of a design, and whether only a payload is unknown."""
    alone = payload_only or aim == "payload"
    usual = "cond" if document else "mixed" if aim is None else "a" if alone else aim
    return criterion or usual, alone


def searched(
    lib: Library,
    until: str | None,
    settings: DesignSettings,
    ways: SessionPlan,
    known: Information,
    gain_error: float,
    **search: Any,
) -> tuple[Design, dict[str, Any], tuple[str, ...]]:
    """Design of the settings, or of the shortest session for --until."""
    if until is None:
        return design(lib, settings, **search), {}, ()
    require_gain_error(gain_error)
    from runtime.campaign.shortest_session import shortest_session
    from runtime.campaign.target import target_of

    error = ModelError(gain=gain_error)
    session = shortest_session(lib, target_of(until), settings, known, error, ways.around, **search)
    facts = session.facts()
    whole = ways.around(session.design.trajectory).duration
    seconds = f"session: {_times(ways, session.design.trajectory)} = {whole:.3g} s"
    if facts["runs"] > 1:
        seconds += f", twice: {2 * whole:.3g} s"
    tried = ", ".join(
        f"{seconds_:.3g} s {session.target.shown(sigma)}"
        for seconds_, sigma in sorted(session.attempts.items())
    )
    sentences = (session.sentence(), seconds, f"tried: {tried}")
    return session.design, {"promise": facts | {"session_s": whole}}, sentences


def _times(ways: SessionPlan, motion: Trajectory) -> str:
    """Time of each part."""
    parts = {"approach": ways.parts.get("approach"), "motion": motion}
    parts["return"] = ways.parts.get("return")
    return " + ".join(
        f"{name} {0.0 if part is None else part.duration:.3g} s" for name, part in parts.items()
    )
