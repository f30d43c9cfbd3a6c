"""`symgen gains` and `symgen payload`: logs without a body on the arm and with one.

Gains follow from a known body, else up to a common factor or with a weighed mass.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from runtime.cli.common import ResultFolder, open_robot, write_recipe
from runtime.cli.log_options import BodyChoices, CoulombSpeed
from runtime.common.files import json_text
from runtime.common.settings import argument_field, data_field, model_field, output_field
from runtime.common.tables import Table
from runtime.common.terminal import command_line, completing, say, say_notes, show
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.regression.samples import NORMAL_95
from runtime.identification.current_gains import Weighed, current_gains, of_gain_one
from runtime.identification.payload.arm_error import arm_model, read_arm_model
from runtime.identification.payload.body import read_known_payload
from runtime.identification.payload.estimate import identify_payload
from runtime.identification.payload.output import FILES, load_facts, write_payload
from runtime.identification.prepared_log import filter_for_accelerations
from runtime.identification.saved_result import read_result
from runtime.identification.sensor_gains import Gains, identify_gains
from runtime.identification.settings import GAIN_SIGMA, Settings, friction_of
from runtime.library import Array, Library
from runtime.library.manifest import common_unit, torque_units
from runtime.recording import Recipe as Plan
from runtime.recording import Recording, read_recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.current_gains import CurrentGains
from runtime.recording.reader import plan_of
from runtime.recording.recipes.recipe_file import recipe_text
from runtime.recording.settings import COLUMNS

OF_BIAS = (
    "a bias has the same effect as friction that differs between the directions; column "
    "offset of identify estimates both, so the recipe holds the gains only"
)
_WIDEST = 100.0  # half width of an interval, N·m, from which the value counts as not identifiable


@dataclass(frozen=True, slots=True, kw_only=True)
class GainsSettings(BodyChoices):
    """Settings of `symgen gains`."""

    options = "payload total_mass robot recipe run recipe_out overwrite"
    empty: str = argument_field(metavar="EMPTY", help="A log without payload.")
    loaded: str | None = argument_field(None, metavar="LOADED", help="A log with known payload.")
    payload: str | None = model_field(
        metavar="KNOWN",
        help="Known payload MASS,CX,CY,CZ in kg and m in the flange frame, with "
        "IXX,IYY,IZZ,IXY,IXZ,IYZ about the centre of mass in kg·m² if known, or a JSON such as "
        "payload.json.",
    )
    total_mass: float | None = model_field(
        metavar="KG", help="With one log: weighed mass of all moving links together."
    )
    weighed: list[str] | None = model_field(
        metavar="LINK=KG", help="With one log: mass of a link from a scale; repeatable."
    )
    friction: str | None = model_field(
        metavar="COLUMNS|none",
        autocompletion=completing((*COLUMNS, "none")),
        help="Friction columns with commas; default from the recipe, else viscous,coulomb.",
    )
    coulomb_speed: CoulombSpeed = None
    loaded_run: str | None = data_field(help="Run of the loaded log; default --run.")
    recipe_out: Path | None = output_field(
        metavar="FILE", help="Write a recipe with these gains, for identify --recipe."
    )


def gains_command(given: GainsSettings) -> None:
    r"""Identify gain and bias of every torque sensor or drive.

    \b
    symgen gains fr3_simulated --total-mass 17.4
    symgen gains empty.csv loaded.csv --robot fr3 --payload 3.021,0,0,0.045
    symgen gains empty.csv loaded.csv --payload payload.json --recipe-out recipe.toml
    symgen gains log.csv --recipe currents.toml --total-mass 17.4
    symgen identify log.csv --recipe recipe.toml

    Record exciting motions without and with a payload of known mass and centre of mass; a
    heavy payload gives accurate gains. Gains, biases, friction and the parameters of the arm are
    estimated together. A gain whose 95 % interval is wider than 10 % is not changed. For motor
    currents, write unit = "A" into the recipe; the gains are then in N·m/A or N/A.
    One log without payload gives the gains up to a common factor, which comes from the masses of
    the URDF, or from weighed masses.
    """
    lib, masses = open_robot(given.robot, given.yes), weighed_masses(given)
    if given.loaded is None and (given.payload is not None or given.loaded_run is not None):
        raise IdentificationError(
            "--payload and the setting loaded_run belong to a second log, with the payload; give "
            "EMPTY and LOADED, or leave them out"
        )
    if given.loaded is not None and (given.payload is None or masses):
        raise IdentificationError(
            "two logs need --payload and take no --total-mass and the setting weighed, which are "
            "for one log; give --payload KNOWN, or one log"
        )
    known = None if given.payload is None else read_known_payload(given.payload)

    def log(name: str, run: str | None) -> Recording:
        read = read_recording(name, given.recipe, run, lib.joint_names)
        return of_gain_one(independent_joints(read, lib))

    empty = log(given.empty, given.run)
    preparation, chosen = filter_for_accelerations(empty, lib, given.cutoff, given.rate)
    stated = Settings(friction=given.friction, coulomb_speed=given.coulomb_speed)
    friction = friction_of(empty, stated)
    plan = plan_of(given.empty, given.recipe, given.run)
    if given.loaded is None or known is None:
        one = current_gains(empty, lib, masses, friction=friction, preparation=preparation)
        notes = one.sentences()
        show(_gains_table(one))
        factors = tuple(float(f"{each:.6g}") for each in _earlier(plan, one.gain) * one.gain)
        head = notes
    else:
        loaded = log(given.loaded, given.loaded_run or given.run)
        gains = identify_gains(
            *(empty, loaded, lib, known, given.link), friction=friction, preparation=preparation
        )
        factors = tuple(map(float, _earlier(plan, gains.gain) / gains.gain))
        show(_table(gains, plan, factors, lib))
        say(f"status: {gains.status}")
        say(f"{gains.n_samples} samples count as {gains.n_effective:.0f} independent ones")
        notes = (*gains.notes, OF_BIAS)
        biases = [", ".join(f"{x:.4g}" for x in row) for row in gains.bias]
        head = (
            f"Gains of torque: {gains.status}.",
            f"Biases, not taken off: {biases[0]} empty, {biases[1]} loaded, N·m or N.",
        )
    say_notes((*chosen, *notes))
    if given.recipe_out is not None:
        torque = replace(plan.signals()["torque"], gain=factors)
        text = recipe_text(plan.replace(torque=torque), *head, command_line())
        write_recipe(given.recipe_out, text, given.overwrite)
        say(f"recipe: {given.recipe_out}")
    elif given.loaded is not None:
        say(f"recipe: [torque] gain = [{', '.join(map(repr, factors))}]")


def _earlier(plan: Plan, like: Array) -> Array:
    """Gains of the recipe before, torque over value in the file."""
    if plan.torque is None:
        raise RecordingError(
            "expected a log with torque or motor currents, got one without; record torque or motor "
            "current"
        )
    before = 1.0 if plan.torque.gain is None else np.array(plan.torque.gain)
    return np.broadcast_to(before, like.shape)


def _table(gains: Gains, plan: Plan, factors: tuple[float, ...], lib: Library) -> Table:
    units = plan.signals()["torque"].unit
    units = (units,) * len(factors) if isinstance(units, str) else units
    outputs = torque_units(lib.manifest)
    if gains.channels != lib.joint_names:  # motors, each of which may drive several joints
        outputs = (common_unit(outputs),) * len(factors)
    pairs = zip(outputs, units, strict=True)
    units = tuple(f"{torque}/A" if unit.endswith("A") else unit for torque, unit in pairs)
    rows = []
    for j, name in enumerate(gains.channels):
        gain = _interval(gains.estimate[j], gains.sigma[j], 4) if gains.is_determined[j] else "-"
        biases = [_interval(gains.bias[k, j], gains.bias_sigma[k, j], 3) for k in range(2)]
        rows.append((name, gain, *biases, _meaning(gains, j, units[j], factors[j])))
    head = ("joint", "gain ± 95 %", "bias empty", "bias loaded", "measures")
    return Table(head, tuple(rows), title="Measured torque over true torque")


def _interval(value: float, sigma: float, digits: int) -> str:
    """Value with its 95 % interval; a dash where the value is not identifiable."""
    half = NORMAL_95 * sigma
    return f"{value:.{digits}f} ± {half:.{digits}f}" if half < _WIDEST else "-"


def _meaning(gains: Gains, j: int, unit: str, factor: float) -> str:
    if not gains.is_determined[j]:
        return "not identifiable"
    if unit.endswith("/A"):
        return f"{factor:.4g} {unit}"
    percent = 100 * (gains.gain[j] - 1)
    if abs(gains.gain[j] - 1) < NORMAL_95 * gains.sigma[j]:
        return "true within ±"
    return f"{abs(percent):.1f} % {'high' if percent > 0 else 'low'}"


def weighed_masses(given: GainsSettings) -> tuple[Weighed, ...]:
    """Masses of --total-mass and the setting weighed."""
    known = [] if given.total_mass is None else [Weighed(given.total_mass)]
    for text in given.weighed or ():
        link, _, kg = text.partition("=")
        try:
            known.append(Weighed(float(kg), link))
        except ValueError:
            raise IdentificationError(
                f"the setting weighed needs LINK=KG, such as forearm=2.31, got '{text}'"
            ) from None
    return tuple(known)


def _gains_table(gains: CurrentGains) -> Table:
    rows = []
    reference = gains.channels[gains.reference]
    for j, name in enumerate(gains.channels):
        value = f"{gains.gain[j]:.4g}"
        ratio = "-"
        if np.isfinite(gains.sigma[j]):
            value += f" ± {NORMAL_95 * gains.sigma[j]:.2g}"
            size = gains.gain[j] / gains.gain[gains.reference]
            half = NORMAL_95 * gains.ratio_sigma[j] * abs(size)
            ratio = f"{size:.4g} ± {half:.2g}" if half else "1"
        rows.append((name, value, ratio, gains.verdicts[j]))
    head = ("joint", "gain ± 95 %", f"ratio to {reference} ± 95 %", "verdict")
    return Table(head, tuple(rows), title="Torque over current, N·m/A or N/A")


_WRITTEN = ResultFolder(FILES, "set_load")


@dataclass(frozen=True, slots=True, kw_only=True)
class PayloadSettings(BodyChoices):
    """Settings of `symgen payload`."""

    options = "robot empty model out recipe run overwrite as_json"
    log: str = argument_field(metavar="LOG", help="A log of the arm with the payload.")
    empty: str | None = data_field(
        metavar="LOG",
        help="A log of the same motion without payload; friction and bias then cancel.",
    )
    model: Path | None = data_field(
        metavar="FOLDER",
        help="Folder written by identify for the arm without payload; default the URDF without "
        "friction.",
    )
    out: Path | None = output_field(
        metavar="FOLDER", help="Folder of the result; default results/LOG-payload."
    )
    empty_run: str | None = data_field(help="Run of the log without payload; default --run.")
    gain_error: float = model_field(
        GAIN_SIGMA,
        metavar="SHARE",
        help="Largest standard deviation of the torque gain of every joint, relative to one; the "
        "intervals include what the residual supports of it.",
    )
    as_json: bool = output_field(False, "--json", help="Print payload.json instead.")


def payload_command(given: PayloadSettings) -> None:
    r"""Identify mass, centre of mass and inertia of a payload.

    \b
    symgen simulate --engine mujoco --out results/empty.csv
    symgen simulate --payload 1.8,0.01,0.02,0.167,0.1,0.08,0.1 --out results/loaded.csv
    symgen payload results/loaded.csv --empty results/empty.csv
    symgen payload loaded.csv --robot fr3 --settings link=fr3_link7 --empty empty.csv
    symgen payload loaded.csv --robot fr3 --model results/first-map --settings cutoff=10

    The most accurate way is to record one motion twice, with and without the payload, and to give
    both logs (--empty). The wrist must turn the payload against gravity. With 0.05 N·m of torque
    noise, ten seconds determine a mass of 1 kg to half a gram. The values are in the frame of the
    flange if the link carries a flange, else in the frame of the link.

    Written: payload.json (values, σ, intervals), set_load.json (arguments of libfranka's setLoad),
    endeffector-config.json (Franka Desk), payload.urdf (a link to append), and for other
    controllers set_target_payload.script (UR), load_data.krl (KUKA), kinova_payload.json and
    xarm_tcp_load.json.
    """
    lib = open_robot(given.robot, given.yes)
    folder = given.out or Path("results") / f"{Path(given.log).stem}-payload"
    _WRITTEN.require(folder, given, given.overwrite)
    saved = read_result(given.model) if given.model else None

    def read(log: str, run: str | None) -> Recording:
        if saved is None:
            return read_recording(log, given.recipe, run, lib.joint_names)
        return saved.log_of(log, lib, given.recipe, run)

    loaded = read(given.log, given.run)
    bare = read(given.empty, given.empty_run or given.run) if given.empty else None
    moved = independent_joints(loaded, lib)
    preparation, chosen = filter_for_accelerations(moved, lib, given.cutoff, given.rate)
    payload = identify_payload(
        loaded,
        lib,
        given.link,
        arm=read_arm_model(given.model, lib) if given.model else arm_model(lib),
        empty=bare,
        preparation=preparation,
        gain_error=given.gain_error,
    )
    _WRITTEN.begin(folder, given)
    paths = write_payload(payload, lib, folder, command_line())
    if given.as_json:
        print(json_text(load_facts(payload, lib)), end="")
        return
    for table in payload.tables():
        show(replace(table, title=payload.heading))  # the status follows
    say(f"status: {payload.status}")
    way = "against the empty run" if payload.differential else f"arm: {payload.arm}"
    say(f"{way}; {payload.n_samples} samples count as {payload.n_effective:.0f} independent ones")
    say_notes((*chosen, *payload.notes))
    say(f"written: {', '.join(map(str, paths))}")
