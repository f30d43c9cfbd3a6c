"""`symgen campaign`."""

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import typer

from runtime.campaign.campaign import Plan, run_campaign
from runtime.campaign.drivers import DRIVERS, DriverSettings
from runtime.campaign.shortest_session import target_of
from runtime.cli.common import Seed, numbers_option, open_robot, sentences_of
from runtime.cli.motion_limits import PlaceChoices
from runtime.common.files import json_text
from runtime.common.settings import method_field, model_field, output_field
from runtime.common.terminal import completing, say
from runtime.common.texts import numbers_of
from runtime.errors import IdentificationError

NOT_REACHED = 1  # exit code where the time ended before the target was reached


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignSettings(PlaceChoices):
    """Settings of `symgen campaign`."""

    options = "target robot out duration driver table obstacles as_json"
    target: str = method_field(
        ..., metavar="v=5mNm|a=1.5%|payload=5g", help="Standard deviation to reach."
    )
    out: Path = output_field(
        Path("results/campaign"), metavar="DIR", help="Folder of all files of the campaign."
    )
    duration: float = method_field(2.5, help="Duration of the first motion at full speed, s.")
    later_duration: float = method_field(10.0, help="Duration of further motions at full speed, s.")
    stages: str = method_field(
        "10,50,100",
        metavar="%,%,…",
        help="Speeds of the first motion's stages, percent of full speed.",
    )
    most_seconds: float = method_field(600.0, help="Motion time after which no motion is begun, s.")
    driver: str = method_field(
        "virtual",
        metavar="NAME[:ADDRESS]",
        autocompletion=completing(DRIVERS),
        help=f"Robot. {sentences_of(DRIVERS)}.",
    )
    gains: str | None = model_field(
        metavar="K,K,…", help="N·m/A or N/A per joint, for a robot that measures currents."
    )
    rehearsal: bool = method_field(
        True, help="Run every motion on the virtual robot with planted faults first."
    )
    seed: Seed = 0
    truth_seed: int = method_field(0, help="Seed of links and sensors of the virtual robot.", min=0)
    as_json: bool = output_field(False, "--json", help="Print JSON instead.")


def campaign_command(given: CampaignSettings) -> None:
    r"""Design, run and identify until a target is reached, on a virtual or real arm.

    \b
    symgen campaign --robot fr3 --target v=20mNm --out results/campaign
    symgen campaign --robot fr3 --target payload=5g --settings stages=50,100
    symgen campaign --robot fr3 --target v=20mNm --driver libfranka:172.16.0.2
    symgen campaign --robot fr3 --target v=20mNm --table 0 --obstacles cell.toml

    Each motion is designed with what is known already. The first runs at 10, 50 and 100 % of its
    speed, further motions at the last of these. Before its first stage a motion runs on the virtual
    robot with planted faults (sign, order, delay, tool, friction, gain), which must be named or
    recovered. A gate releases each stage: the motion keeps every limit, the last log has no error,
    and it agrees with the model. Guards on every sample stop the robot. Targets: v the torque of
    motions never seen, a the base parameters over their sizes, payload the mass of a payload that
    the last motion carries. A robot that stands elsewhere first follows a
    certified way to the start. Motions and ways keep away from --table, the setting box and
    --obstacles.

    Every step is a file in DIR. After Ctrl-C, a refused gate or a stop, the same command continues.
    Exit code 1: the time ended before the target was reached.
    """
    wanted = target_of(given.target)
    times = given.values("duration", "later_duration", "most_seconds")
    stages, seed = _speeds(given.stages), given.seed
    plan = Plan(given.target, stages=stages, seed=seed, rehearses=given.rehearsal, **times)
    lib = open_robot(given.robot, given.yes)
    safety = given.safety()
    gains = None
    if given.gains is not None:
        gains = np.array(numbers_option(given.gains, lib.n_joints, "the setting gains"))
    name, _, address = given.driver.partition(":")
    settings = DriverSettings(address, given.seed, given.truth_seed, gains)
    robot_driver = DRIVERS[name].open(lib, settings)
    try:
        report = (lambda _: None) if given.as_json else say
        outcome = run_campaign(robot_driver, plan, wanted, given.out, report, safety=safety)
    finally:
        robot_driver.close()
    if given.out.is_dir():
        given.write(given.out)
    if given.as_json:
        facts = asdict(outcome) | {"target": wanted.text, "folder": str(given.out)}
        print(json_text(facts, allow_nan=True), end="")
    else:
        say(outcome.sentence)
    if not outcome.is_reached:
        raise typer.Exit(NOT_REACHED)


def _speeds(text: str) -> tuple[float, ...]:
    if not (speeds := numbers_of(text)):
        raise IdentificationError(
            f"expected speeds in percent with commas, got '{text:.40}'; correct the setting stages"
        )
    return speeds
