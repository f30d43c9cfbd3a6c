"""`symgen payload`."""

from dataclasses import dataclass, replace
from pathlib import Path

from runtime.cli.common import ResultFolder, open_robot
from runtime.cli.log_options import BodyChoices
from runtime.common.files import json_text
from runtime.common.settings import argument_field, data_field, model_field, output_field
from runtime.common.terminal import command_line, say, say_notes, show
from runtime.identification.payload.arm_error import arm_model, read_arm_model
from runtime.identification.payload.estimate import identify_payload
from runtime.identification.payload.output import FILES, load_facts, write_payload
from runtime.identification.prepared_log import filter_for_accelerations
from runtime.identification.saved_result import read_result
from runtime.identification.settings import GAIN_SIGMA
from runtime.recording import Recording, read_recording
from runtime.recording.coupled_joints import independent_joints

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
