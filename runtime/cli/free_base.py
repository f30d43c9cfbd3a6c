"""What `symgen identify` prints of a robot with a free base."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from runtime.common.tables import Table
from runtime.common.terminal import VERBOSE, show
from runtime.estimators.problem import OF
from runtime.estimators.uncertainty import PRIOR_DOMINATED
from runtime.identification.free_base.drives import rms
from runtime.identification.free_base.result import FreeBaseIdentification
from runtime.identification.free_base.rows import CROSSTALK, DELAY
from runtime.identification.result_record import ResultRecord
from runtime.library.parameters import PI_NAMES
from runtime.recording.recipes.recipe import COMMANDED


def print_walk(result: FreeBaseIdentification) -> Iterator[str]:
    """Show the errors, and give the sentences on a result."""
    record, tested = result.record, result.predictions
    print_errors(
        f"{result.lib.name}: errors on the last {np.ptp(tested['t']):.3g} s",
        *(record.rows_of_errors[0], rms(tested["measured"]).tolist()),
        *(record.torque_rms.before, record.torque_rms.after),
    )
    if not result.is_consistent:
        yield "links: NOT physically consistent; --method map gives bodies that are"
    if record.total_mass is not None:
        mass = record.total_mass
        low, high = mass.interval
        yield (
            f"total mass: {mass.value:.3f} kg, 95 % interval {low:.3f} to {high:.3f}, URDF "
            f"{mass.urdf:.3f}"
        )
    if record.vertical_force is not None:
        force = record.vertical_force
        yield (
            f"sum of vertical forces: error {force.after_percent:.2f} % of {force.mean:.1f} "
            f"N, of the URDF {force.before_percent:.2f} %"
        )
    if record.sessions is not None:
        yield f"repeatability: {record.sessions.repeatability.sentence}"
    yield from _sentences(record)


def print_errors(title: str, names: Sequence[str], *columns: Sequence[float]) -> None:
    """Print RMS values per row, before and after, in the units of the rows."""
    cells = [[f"{value:.4g}" for value in column] for column in columns]
    head = ("row", "RMS", "before RMS", "after RMS")
    show(Table(head, tuple(zip(names, *cells, strict=True)), title=title))


def _sentences(record: ResultRecord) -> Iterator[str]:
    for name, sensor in (record.sensors or {}).items():
        value, sigma = sensor.value or 0.0, sensor.sigma or 0.0
        if name == "sharing":
            yield f"sensors: γ = {value:+.3f} ± {sigma:.3f} while contacts share the load"
        elif name in CROSSTALK:
            yield f"sensors: {value:+.3f} ± {sigma:.3f} N per N·m about {name[-1]} of the link"
        else:
            yield f"sensors: offset of {name} {value:+.2f} ± {sigma:.2f} N"
    friction = record.friction
    if friction is not None:
        sigmas = friction.sigma or friction.values
        for joint, values, spread in zip(record.joints, friction.values, sigmas, strict=True):
            for column, each, error in zip(friction.columns, values, spread, strict=True):
                yield f"drives: {column}{OF}{joint} {_with_sigma(each, error)}"
    late = DELAY if record.torque_source == COMMANDED else "delay of the torque"
    for delay in record.delays:
        yield f"drives: {late} {_with_sigma(delay.value, delay.sigma)}"
    yield from _of_links(record)
    for note in record.warnings:
        yield f"note: {note}"


def _of_links(record: ResultRecord) -> Iterator[str]:
    """Parameters that the motion does not determine: of every link with --verbose, else a count."""
    links = () if record.uncertainty is None else record.uncertainty.links
    listed = {}
    for body, known in zip(record.links, links, strict=True):
        pairs = zip(PI_NAMES, known.verdicts, strict=True)
        if names := [name for name, verdict in pairs if verdict == PRIOR_DOMINATED]:
            listed[body.name] = names
    if VERBOSE.get():
        for link, names in listed.items():
            yield f"link {link}: not identifiable {', '.join(names)}"
    elif listed:
        yield (
            f"links: this motion does not identify all parameters of {len(listed)} of "
            f"{len(record.links)}; --verbose lists them"
        )


def _with_sigma(value: Any, sigma: Any) -> str:
    return f"{value:.4g} ± {sigma:.2g}" if sigma is not None else "is not identifiable"
