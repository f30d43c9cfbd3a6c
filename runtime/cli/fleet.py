"""`symgen fleet`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.cli.common import Overwrite, counting, open_robot
from runtime.cli.log_options import OfResult
from runtime.common.files import json_text, replacing, require_unused
from runtime.common.settings import argument_field, method_field, output_field, settings_place
from runtime.common.tables import Table, significant
from runtime.common.terminal import say, show
from runtime.common.threads import one_blas_thread
from runtime.errors import RuntimeFault
from runtime.identification.statistics_file import read_statistics
from runtime.library import Library
from runtime.library.parameters import links, mass
from runtime.monitoring.fleet.fleet_prior import (
    FleetFit,
    FleetFriction,
    fit_fleet,
    fit_friction,
    fit_noise,
    prior_text,
    write_prior,
)
from runtime.monitoring.fleet.gather import Unit, gather, remove_parts, statistics_files

SHOWN = 20  # units that are printed, those that differ most first


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetSettings(OfResult):
    """Settings of `symgen fleet`."""

    options = "out robot overwrite as_json"
    folder: Path = argument_field(
        metavar="DIR", help="Folder with results of identify --settings save_statistics=true."
    )
    out: Path = output_field(Path("fleet.toml"), metavar="FILE", help="Prior of the type, as TOML.")
    scheduler: str | None = method_field(
        metavar="tcp://HOST:PORT", help="Read the files on the workers of this dask cluster."
    )
    overwrite: Overwrite = False
    as_json: bool = output_field(False, "--json", help="Print JSON instead.")


@one_blas_thread
def fleet_command(given: FleetSettings) -> None:
    r"""Compute the prior of a type of robot from many units of it.

    \b
    symgen identify fr3_simulated --settings save_statistics=true --out units/u01
    symgen identify fr3_simulated --settings save_statistics=true --out units/u02
    symgen identify fr3_simulated --settings save_statistics=true --out units/u03
    symgen fleet units --out fleet.toml
    symgen identify new.csv --prior fleet.toml

    Centre and spread of the inertias and of the friction come from the compressed statistics of
    each unit; no log is needed. With it a new unit is identified from a short motion.

    Units that differ from the others by more than the spread stand out; they are listed with the
    link that differs most and do not count for the prior. Written are the prior, and beside it an
    NPZ of the same name with the parameters of every unit. A run that was interrupted continues
    with the same command.
    """
    if given.out.suffix != ".toml":
        raise RuntimeFault(
            f"expected a file that ends in .toml for the prior, got '{given.out}'; the parameters "
            "of the units are written beside it as NPZ"
        )
    beside = given.out.with_suffix(".npz")
    require_unused([given.out, beside, settings_place(given.out)], given.overwrite)
    files = statistics_files(given.folder)
    lib = open_robot(given.robot or read_statistics(files[0]).robot, given.yes, True)
    parts = given.out.with_name(f"{given.out.name}.parts")
    with counting() as progress:
        task = progress.add_task("statistics", total=len(files))

        def shown(done: int, _: int) -> None:
            progress.update(task, completed=done)

        units = gather(lib, given.folder, parts, scheduler=given.scheduler, progress=shown)
    fit = fit_fleet(lib, units)
    friction = fit_friction(lib, units, fit)
    names = [unit.name for unit in units]
    write_prior(given.out, prior_text(lib, names, fit, friction, fit_noise(units, fit)), lib)
    given.write(given.out)
    with replacing(beside) as file:
        columns = np.asarray(friction.columns or ("",))
        known: dict[str, Any] = {"pi": fit.pi, "p_value": fit.p_value, "stands_out": fit.stands_out}
        np.savez(file, names=np.asarray(names), **known, columns=columns, phi=friction.units)
    remove_parts(parts)
    if given.as_json:
        print(json_text(_facts(lib, units, fit, friction, given.out)), end="")
        return
    _show(lib, units, fit)
    say(f"prior: {given.out}; use it with: identify LOG --prior {given.out}")


def _facts(
    lib: Library, units: list[Unit], fit: FleetFit, friction: FleetFriction, out: Path
) -> dict[str, Any]:
    low, high = fit.interval
    return {
        "robot": lib.name,
        "prior": str(out),
        "units": len(units),
        "kappa": fit.kappa,
        "kappa_interval": [low, high],
        "spread_percent": 100 / float(np.sqrt(fit.kappa)),
        "trust": fit.trust,
        "stand_out": [
            {
                "unit": units[k].name,
                "p_value": float(fit.p_value[k]),
                "link": _link(lib, fit, int(k))[0],
                "mass_difference": _link(lib, fit, int(k))[1],
            }
            for k in np.flatnonzero(fit.stands_out)
        ],
        "links": [
            {"name": name, "mass": float(mass(body))}
            for name, body in zip(lib.link_names, links(fit.centre), strict=True)
        ],
        "friction_columns": list(friction.columns),
    }


def _link(lib: Library, fit: FleetFit, k: int) -> tuple[str, float]:
    """Link that differs most from the type, and the difference of its mass [kg]."""
    at = int(fit.links[k])
    difference = mass(links(fit.pi[k])[at]) - mass(links(fit.centre)[at])
    return lib.link_names[at], float(difference)


def _show(lib: Library, units: list[Unit], fit: FleetFit) -> None:
    low, high = (100 / np.sqrt(end) for end in reversed(fit.interval))
    out = int(fit.stands_out.sum())
    say(
        f"{len(units)} units of '{lib.name}' differ by {significant(100 / np.sqrt(fit.kappa))} % "
        f"(95 %: {low:.2g} to {significant(high)} %)"
        + (f"; {out} of them stand out and do not count" if out else "; none stands out")
    )
    rows = []
    for k in np.argsort(-fit.statistic)[:SHOWN]:
        where: tuple[str, ...] = ("", "", "no")
        if fit.stands_out[k]:
            name, difference = _link(lib, fit, int(k))
            where = (name, f"{difference:+.3f}", "yes")
        rows.append((units[k].name, f"{fit.statistic[k]:.0f}", f"{fit.p_value[k]:.1e}", *where))
    head = ("unit", "T", "p, corrected", "link", "mass against the type [kg]", "stands out")
    show(Table(head, tuple(rows), title="units that differ most from the type"))
