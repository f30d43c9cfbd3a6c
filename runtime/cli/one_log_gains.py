"""`symgen gains` on one log: gains up to a common factor, or with a weighed mass."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.table import Column, Table

from runtime.cli.overwriting import write_recipe
from runtime.cli.prepared_log import friction_of, preparation_of
from runtime.common.terminal import command_line, console, say
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.regression.samples import NORMAL_95
from runtime.identification.current_gains.one_log import Weighed, current_gains
from runtime.identification.current_gains.scaling import of_gain_one
from runtime.library import Library
from runtime.recording import Recipe, plan_of, read_recording, recipe_text
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.current_gains import CurrentGains


def weighed_masses(total: float | None, links: Sequence[str]) -> tuple[Weighed, ...]:
    """Masses of --total-mass and --weighed."""
    known = [] if total is None else [Weighed(total)]
    for text in links:
        link, _, kg = text.partition("=")
        try:
            known.append(Weighed(float(kg), link))
        except ValueError:
            raise IdentificationError(
                f"--weighed needs LINK=KG, such as forearm=2.31, got '{text}'"
            ) from None
    return tuple(known)


def print_gains_of_one_log(
    log: str,
    lib: Library,
    weighed: Sequence[Weighed],
    *,
    recipe: str | None,
    run: str | None,
    friction: str | None,
    coulomb_speed: float | None,
    cutoff: float | None,
    rate: float | None,
) -> tuple[CurrentGains, Recipe]:
    """Estimate and print the gains of one log."""
    recording = of_gain_one(
        independent_joints(read_recording(log, recipe, run, lib.joint_names), lib)
    )
    gains = current_gains(
        recording,
        lib,
        weighed,
        friction=friction_of(recording, friction, coulomb_speed),
        preparation=preparation_of(recording, cutoff, rate),
    )
    console.print(_table(gains))
    for sentence in gains.sentences():
        say(f"note: {sentence}")
    plan = plan_of(log, recipe, run)
    if plan.torque is None:
        raise RecordingError(
            "expected a log with motor currents, got one without; record torque or motor current"
        )
    before = 1.0 if plan.torque.gain is None else np.array(plan.torque.gain)
    factors = np.broadcast_to(before, gains.gain.shape) * gains.gain
    return gains, with_factors(plan, tuple(float(f"{each:.6g}") for each in factors))


def with_factors(plan: Recipe, factors: tuple[float, ...]) -> Recipe:
    """The recipe with these gains."""
    torque = plan.signals()["torque"]
    return plan.replace(torque=replace(torque, gain=factors))


def write_gains(path: Path, gains: CurrentGains, plan: Recipe, overwrite: bool) -> None:
    """Write the recipe of `symgen gains LOG --recipe-out`."""
    text = recipe_text(plan, *gains.sentences(), command_line())
    write_recipe(path, text, overwrite)


def _table(gains: CurrentGains) -> Table:
    table = Table(Column("joint", overflow="fold"), title="Torque over current, N·m/A or N/A")
    reference = gains.channels[gains.reference]
    for head in ("gain ± 95 %", f"ratio to {reference} ± 95 %"):
        table.add_column(head, justify="right")
    table.add_column("verdict")
    for j, name in enumerate(gains.channels):
        value = f"{gains.gain[j]:.4g}"
        ratio = "-"
        if np.isfinite(gains.sigma[j]):
            value += f" ± {NORMAL_95 * gains.sigma[j]:.2g}"
            size = gains.gain[j] / gains.gain[gains.reference]
            half = NORMAL_95 * gains.ratio_sigma[j] * abs(size)
            ratio = f"{size:.4g} ± {half:.2g}" if half else "1"
        table.add_row(name, value, ratio, gains.verdicts[j])
    return table
