"""`symgen observe`."""

from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.cli.common import Overwrite, ResultFolder
from runtime.cli.log_options import Log, OfResult, Recipe, Run, open_result
from runtime.common.files import folder_of, json_text, replacing, write_json
from runtime.common.settings import data_field, method_field, model_field, output_field
from runtime.common.tables import Table, significant
from runtime.common.terminal import command_line, say, say_notes, show
from runtime.errors import ExportError, IdentificationError
from runtime.identification.posterior_file import read_posterior
from runtime.library import Library
from runtime.library.manifest import file_units
from runtime.monitoring import observation
from runtime.monitoring.calibration import (
    USUAL,
    FreeMotion,
    Tail,
    calibrated_on,
    is_short,
    rate_interval,
    verified,
)
from runtime.monitoring.model import MonitoredModel, model_of
from runtime.monitoring.noise import alarm_rate, read_held_out
from runtime.monitoring.observer import wrench_at
from runtime.outputs import torque_mcap
from runtime.outputs.observer_c import FILES, observer_c
from runtime.outputs.report import canvas
from runtime.recording import Recording
from runtime.recording.consistency import require_plausible

_SIGNALS = ("contacts.json", "external_torque.npz", "external_torque.png")
_WRITTEN = ResultFolder((*_SIGNALS, *FILES, *torque_mcap.FILES), "contacts")
RAISED = 2.0  # threshold by a calibration over that without, from which it is said
OFTEN = 2.0  # expected over stated rate of false alarms from which it is said
SHOWN = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserveSettings(OfResult):
    """Settings of `symgen observe`."""

    options = "model out free robot overwrite recipe run as_json"
    log: Log
    model: Path = data_field(..., metavar="RESULT", help="Folder written by identify.")
    false_alarms: str = method_field(
        "1 per hour",
        metavar="RATE",
        help="Rate of false alarms of all joints together: '1 per hour', '2 per day'.",
    )
    out: Path | None = output_field(metavar="DIR", help="Folder of files; default RESULT/observe.")
    free: str | None = method_field(
        metavar="LOG", help="A log without contacts, on which the rate is verified."
    )
    calibrate: list[str] | None = method_field(
        metavar="LOG",
        help="A log without contacts, from whose residuals thresholds are fitted; may be given "
        "again.",
    )
    link: str | None = model_field(
        metavar="LINK", help="Link that is touched: its contact wrench is computed."
    )
    within: float | None = method_field(
        metavar="S",
        help="Time in which the observer shows 95 % of a contact, s; default "
        f"{observation.WITHIN_S:g}, or three samples.",
    )
    mcap: bool = output_field(
        False, help="Write the torques as MCAP too, with a PlotJuggler layout."
    )
    overwrite: Overwrite = False
    recipe: Recipe = None
    run: Run = None
    as_json: bool = output_field(False, "--json", help="Print JSON instead.")


def observe_command(given: ObserveSettings) -> None:
    r"""Compute the external torque of a log and find contacts.

    \b
    symgen observe fr3_simulated --model results/fr3_simulated-map
    symgen observe second.csv --model results/first-map --settings false_alarms="1 per hour"
    symgen observe second.csv --model results/first-map --free third.csv --settings link=fr3_link7
    symgen observe second.csv --model results/first-map --settings calibrate=half_hour.csv

    A generalised-momentum observer with the identified model, friction, rotors and the delay of the
    torque: the result is positive where the environment pushes in the direction of the joint. A
    contact is reported where it exceeds a threshold; thresholds follow from the stated rate of
    false alarms, the model's posterior and the residuals of its test part. With the setting
    calibrate their level is fitted to the largest residuals of free motion: half an hour of it
    gives rates down to one alarm per hour, where residuals are not Gaussian. Biases and friction
    that differ from day to day are learnt while the observer runs, from the first 0.3 s on.
    --recipe holds for all logs.

    Written are external_torque.npz (t, r, sigma, threshold), contacts.json, external_torque.png
    and observer.c, the same observer for a control loop, with observer.h and example_observer.c.
    --settings mcap=true adds external_torque.mcap (/measured, /predicted, /external) and the layout
    external_torque.plotjuggler.xml.
    """
    rate = alarm_rate(given.false_alarms)
    folder = given.out or folder_of(given.model) / "observe"
    _WRITTEN.require(folder, given, given.overwrite)
    saved, lib, notes = open_result(given, given.model)
    known = model_of(saved, lib)
    data = _read(lib, known, saved.log_of(given.log, lib, given.recipe, given.run))
    warnings: list[str] = []
    try:  # root of the covariance of [β; φ]
        root = read_posterior(given.model, saved, lib).of_readings().root(lib)
    except IdentificationError as error:
        root = None
        warnings = [f"thresholds are without the uncertainty of the model: {error}"]
    held_out = read_held_out(given.model, known)
    rate_hz = data.rate_hz  # of the observer; free motion at another one is interpolated
    free_logs = [saved.log_of(each, lib, given.recipe) for each in given.calibrate or ()]
    free_motion = [_read(lib, known, each, rate_hz) for each in free_logs]
    # The observer that is calibrated is chosen on the same motion, so that no contact decides.
    chosen_on = free_motion[0] if free_motion else data
    detector = observation.detector_for(lib, known, chosen_on, held_out, rate, given.within, root)
    tails: tuple[Tail, ...] = ()
    if free_motion:
        plain = detector
        has_speeds = all(each.dq is not None for each in free_logs)
        detector, tails = calibrated_on(lib, plain, free_motion, has_speeds)
        warnings = _of_calibration(lib, plain, detector, tails)
    signals = observation.signals_of(lib, detector, data)
    seen = observation.observation_of(lib, detector, signals)
    free = None if given.free is None else saved.log_of(given.free, lib, given.recipe)
    check = None if free is None else verified(lib, detector, _read(lib, known, free, rate_hz))
    contents: dict[str, bytes] = {}
    try:
        for name, text in observer_c(lib, detector, np.median(signals.model_band, axis=0)).items():
            contents[name] = text.encode()
    except ExportError as error:  # a part of the model has no C code
        warnings.append(str(error))
    if given.mcap:
        bag, layout = torque_mcap.FILES
        contents[bag] = torque_mcap.torque_mcap(lib.joint_names, data, seen)
        contents[layout] = torque_mcap.plotjuggler_layout(lib.joint_names).encode()
    facts = _facts(lib, detector, seen, check, data, given.link, [*notes, *warnings], tails)
    _WRITTEN.begin(folder, given)
    with replacing(folder / "external_torque.npz") as file:
        np.savez_compressed(file, t=seen.t, r=seen.r, sigma=seen.sigma, threshold=seen.threshold)
    write_json(folder / "contacts.json", facts | {"command": command_line()}, allow_nan=True)
    draw_external_torque(seen, lib.joint_names, saved.record.units, folder / "external_torque.png")
    for name, content in contents.items():
        with replacing(folder / name) as file:
            file.write(content)
    if given.as_json:
        print(json_text(facts), end="")
    else:
        _show(facts, folder)


def _read(
    lib: Library, model: MonitoredModel, recording: Recording, rate_hz: float | None = None
) -> Recording:
    require_plausible(recording, lib)
    if recording.tau is None:
        raise IdentificationError(
            f"expected torque in the log '{recording.name}', and there is none; record tau"
        )
    return observation.prepared_for(recording, model, rate_hz)


def _of_calibration(
    lib: Library, plain: observation.Detector, fitted: observation.Detector, tails: tuple[Tail, ...]
) -> list[str]:
    """Too little free motion for the stated rate, and thresholds that lose contacts."""
    notes, rate = [], fitted.rate
    if is_short(tails, rate.per_second):
        seen, usual = tails[0].seconds / 60, USUAL / rate.per_second / 60
        notes.append(
            f"{seen:.2g} min of free motion are too few for {rate.text}, and the thresholds are "
            f"extrapolated from few motions; calibrate with {usual:.2g} min or more"
        )
    units, thresholds = file_units(lib.manifest), (plain.thresholds, fitted.thresholds)
    for name, unit, old, new in zip(lib.joint_names, units, *thresholds, strict=True):
        if new > RAISED * old:
            notes.append(
                f"the calibration raises the threshold of {name} from {old:.3g} to {new:.3g} "
                f"{unit}: a contact below that is not found; if the motion contains contacts or "
                "another load, calibrate with another log"
            )
    return notes


def _facts(
    lib: Library,
    detector: observation.Detector,
    seen: observation.Observation,
    check: FreeMotion | None,
    data: Recording,
    link: str | None,
    notes: list[str],
    tails: tuple[Tail, ...],
) -> dict[str, Any]:
    contacts = []
    for contact in seen.contacts:
        entry: dict[str, Any] = asdict(contact) | {"number": contact.number + 1}
        if link is not None:
            inside = (seen.t >= contact.time_s) & (seen.t <= contact.end_s)
            external = np.nanmedian(seen.r[inside], axis=0)
            entry["wrench"] = asdict(wrench_at(lib, data.q[inside][0], external, link))
        contacts.append(entry)
    settings = detector.settings
    return {
        "robot": lib.name,
        "joints": list(lib.joint_names),
        "units": file_units(lib.manifest),
        "seconds": seen.seconds,
        "contacts": contacts,
        "alarms": len(contacts),
        "thresholds": np.median(seen.threshold, axis=0).tolist(),
        "sigma": detector.noise.sigma.tolist(),
        "false_alarms": {
            "stated": detector.rate.text,
            "per_hour": detector.rate.per_second * 3600,
            "expected_in_log": detector.rate.per_second * seen.seconds,
            "by_stretches_per_hour": None if tails else detector.expected_rate * 3600,
        },
        "calibration": _calibration(tails, detector) if tails else None,
        "free_motion": None if check is None else asdict(check),
        "observer": {
            "bandwidth": settings.bandwidth,
            "window_s": settings.steps / settings.rate_hz,
            "velocity": settings.velocity,
            "rate_hz": settings.rate_hz,
            "within_s": detector.within_s,
        },
        "notes": notes,
    }


def _calibration(tails: tuple[Tail, ...], detector: observation.Detector) -> dict[str, Any]:
    """Duration, 95 % interval of the rate, and what was fitted to every joint."""
    low, high = rate_interval(tails, detector.levels, detector.rate.per_second)
    return {
        "seconds": tails[0].seconds,
        "per_hour_95": [3600 * low, 3600 * high],
        "peaks": [len(tail.peaks) - 1 for tail in tails],
        "largest": [float(tail.peaks[0]) for tail in tails],
        "shape": [tail.shape for tail in tails],
    }


def draw_external_torque(
    seen: observation.Observation, names: tuple[str, ...], units: tuple[str, ...], path: Path
) -> None:
    """Write a figure with one panel per joint: r, its thresholds, contacts shaded."""
    t = seen.t
    rows = np.arange(0, len(t), max(1, len(t) // canvas.POINTS))
    with canvas.picture(path, (10.0, 1.2 + 1.1 * len(names)), dpi=110) as figure:
        axes = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
        for j, (axis, name, unit) in enumerate(zip(axes, names, units, strict=True)):
            for contact in seen.contacts:
                if contact.number == j:
                    axis.axvspan(
                        contact.time_s, contact.end_s, color=canvas.VERMILION, alpha=0.3, lw=0
                    )
            curve = canvas.thinned(t, seen.r[:, j], canvas.POINTS)
            axis.plot(*curve, color=canvas.BLUE, linewidth=0.8)
            for sign in (1, -1):
                bound = sign * seen.threshold[rows, j]
                axis.plot(t[rows], bound, color=canvas.GREY, linewidth=0.8)
            axis.set_title(f"{name} [{unit.replace('*', '·')}]")
            axis.margins(x=0)
        axes[-1].set_xlabel("t [s]")
        canvas.heading(figure, "external torque (blue), thresholds (grey), contacts (shaded)")


def _show(facts: dict[str, Any], folder: Path) -> None:
    stated, alarms = facts["false_alarms"], facts["alarms"]
    head = ("joint", "σ of free motion", "threshold, median", "unit", "contacts")
    columns = zip(facts["joints"], facts["sigma"], facts["thresholds"], facts["units"], strict=True)
    count = Counter(contact["joint"] for contact in facts["contacts"])
    rows = tuple((n, f"{s:.3g}", f"{bar:.3g}", unit, str(count[n])) for n, s, bar, unit in columns)
    show(Table(head, rows, title=f"{facts['robot']}: thresholds at {stated['stated']}"))
    say(
        f"{alarms} contact{'s' * (alarms != 1)} in {facts['seconds']:.3g} s; at the stated rate "
        f"{significant(stated['expected_in_log'])} false alarms are expected in this time"
    )
    likely = stated["by_stretches_per_hour"]
    if likely is not None and likely > OFTEN * stated["per_hour"]:
        say(
            f"the noise differs between stretches of motion: about {significant(likely)} "
            "false alarms per hour are to be expected; the setting calibrate with free motion "
            "gives the stated rate"
        )
    if facts["calibration"] is not None:
        low, high = facts["calibration"]["per_hour_95"]
        say(
            f"thresholds are fitted to {facts['calibration']['seconds'] / 60:.2g} min of free "
            f"motion: {stated['stated']} means {significant(low)} to {significant(high)} per hour"
        )
    for contact in facts["contacts"][:SHOWN]:
        say(f"contact: {contact['time_s']:.3f} s, {contact['joint']}, {contact['torque']:+.3g}")
    if alarms > SHOWN:
        say(f"{alarms - SHOWN} more contacts are in contacts.json")
    check = facts["free_motion"]
    if check is not None:
        say(
            f"free motion: {check['alarms']} alarms, {significant(check['expected'])} expected; "
            f"so many or more have a probability of {check['probability']:.2g} at the stated rate"
        )
    say_notes(facts["notes"])
    say(f"files: {folder}")
