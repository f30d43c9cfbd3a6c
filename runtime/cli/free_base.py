"""`symgen identify` of a robot with a free base."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from runtime.cli.common import ResultFolder
from runtime.cli.identify_settings import IdentifySettings
from runtime.cli.log_options import fractions_of
from runtime.common.tables import Table
from runtime.common.terminal import VERBOSE, command_line, say, show
from runtime.errors import IdentificationError
from runtime.estimators.friction_bounds import OF
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.uncertainty import PRIOR_DOMINATED
from runtime.identification.free_base.drives import COLUMNS, EARLIEST_S, LATEST_S
from runtime.identification.free_base.identify import SHARE, identify_free_base
from runtime.identification.free_base.result import write_free_base
from runtime.identification.free_base.rows import CROSSTALK, DELAY
from runtime.identification.result_record import ResultRecord
from runtime.identification.settings import AUTO, NO_FRICTION
from runtime.library import Library
from runtime.library.parameters import PI_NAMES
from runtime.outputs.model_files.export import write_urdf
from runtime.outputs.report.report import write_report
from runtime.recording.free_base import FreeBaseRecording, read_free_base

TAKEN = (
    *("logs", "robot", "yes", "rows", "cutoff", "split", "prior", "out", "overwrite"),
    *("friction", "delay", "report"),
)
"""Parameters of the command that apply to a robot with a free base."""
_FILES = ("result.json", "predictions.npz", "posterior.npz", "identified.urdf", "report.html")
WRITTEN = ResultFolder(_FILES, "robot")


def _of_drives(
    given: IdentifySettings, recording: FreeBaseRecording
) -> tuple[tuple[str, ...], float | None]:
    """Friction columns and the stated delay of commanded torques."""
    stated = {"--friction": given.friction, "--delay": given.delay}
    names = [name for name, value in stated.items() if value is not None]
    if names and not recording.is_commanded:
        raise IdentificationError(
            f"{names[0]} does not apply to a robot with a free base whose torques are not "
            f"commanded, and {recording.name} has no tau_command or q_des; leave it out"
        )
    words = COLUMNS if given.friction is None else tuple(given.friction.split(","))
    delay = None if given.delay in {None, AUTO} else _seconds(str(given.delay))
    return () if words == (NO_FRICTION,) else words, delay


def identify_free_base_log(lib: Library, given: IdentifySettings, prior: PriorFile | None) -> None:
    """Read a log, identify, write result.json, identified.urdf and report, and print the errors."""
    unused = [option for name, option in given.stated().items() if name not in TAKEN]
    if unused:
        raise IdentificationError(
            f"{unused[0]} does not apply to a robot with a free base; leave it out"
        )
    if len(given.logs) != 1:
        raise IdentificationError(
            f"expected one log of a robot with a free base, got {len(given.logs)}; identify each "
            "alone"
        )
    path = Path(given.logs[0])
    recording = read_free_base(path)
    choice = given.rows or ("base" if recording.tau is None else "all")
    friction, delay = _of_drives(given, recording)
    folder = given.out or Path("results") / f"{path.stem}-{choice}"
    WRITTEN.require(folder, given, given.overwrite)
    result = identify_free_base(
        recording,
        lib,
        choice,
        cutoff_hz=None if given.cutoff is None else _number(given.cutoff, "--cutoff"),
        share=SHARE if given.split is None else _share(given.split),
        prior=prior,
        friction=friction,
        delay_s=delay,
    )
    WRITTEN.begin(folder, given)
    record = write_free_base(result, folder, command_line())
    print_errors(
        f"{lib.name}: errors on the last {result.seconds:.3g} s",
        *(record.rows_of_errors[0], result.rms.tolist()),
        *(record.torque_rms.before, record.torque_rms.after),
    )
    if record.total_mass is not None:
        mass = record.total_mass
        low, high = mass.interval
        say(
            f"total mass: {mass.value:.3f} kg, 95 % interval {low:.3f} to {high:.3f}, URDF "
            f"{mass.urdf:.3f}"
        )
    if record.vertical_force is not None:
        force = record.vertical_force
        say(
            f"sum of vertical forces: error {force.after_percent:.2f} % of {force.mean:.1f} "
            f"N, of the URDF {force.before_percent:.2f} %"
        )
    for sentence in _sentences(record):
        say(sentence)
    urdf = folder / "identified.urdf"
    say(f"URDF:   {urdf} ({write_urdf(lib, result.pi, urdf)})")
    if given.report:
        say(f"report: {write_report(folder)}")
    else:
        (folder / "report.html").unlink(missing_ok=True)  # of a result that this one replaces
    say(f"result: {folder / 'result.json'}")


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
    for delay in record.delays:
        yield f"drives: {DELAY} {_with_sigma(delay.value, delay.sigma)}"
    yield from _of_links(record)
    for note in record.warnings:
        yield f"note: {note}"


def _of_links(record: ResultRecord) -> Iterator[str]:
    """Parameters that the motion does not determine: of every link with --verbose, else a count."""
    links = () if record.uncertainty is None else record.uncertainty.links
    unknown = {
        link.name: [
            name
            for name, verdict in zip(PI_NAMES, known.verdicts, strict=True)
            if verdict == PRIOR_DOMINATED
        ]
        for link, known in zip(record.links, links, strict=True)
    }
    listed = {link: names for link, names in unknown.items() if names}
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


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = float("nan")
    if not EARLIEST_S <= seconds <= LATEST_S:
        raise IdentificationError(
            f"--delay needs {AUTO} or a number of {EARLIEST_S:g} to {LATEST_S:g} s here, got "
            f"'{text}'"
        )
    return seconds


def _share(text: str) -> float:
    """Share of the training: B of "A,B", since map trains on the validation part as well."""
    if "," not in text:
        return _number(text, "--split")
    return fractions_of(text)[1]


def _number(text: str, option: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0 < value < float("inf"):
        raise IdentificationError(f"{option} needs a number above 0 here, got '{text}'")
    return value
