"""`symgen export` and `symgen sample`: models of a result for other programs."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import typer

from runtime.cli.common import Overwrite, ResultFolder, Seed, listed
from runtime.cli.log_options import ResultChoices, open_result
from runtime.common.files import folder_of
from runtime.common.settings import output_field
from runtime.common.tables import significant
from runtime.common.terminal import completing, console, say, say_notes
from runtime.errors import ExportError, IdentificationError
from runtime.identification.posterior_file import read_posterior
from runtime.monitoring.posterior_draws import draw_models
from runtime.outputs.model_files import sampled_models
from runtime.outputs.model_files.export import export
from runtime.outputs.model_files.export_format import EXPORT_FORMATS, usual_formats
from runtime.outputs.model_files.model import springs_left_out

THICKENED = (
    "the prior takes thin links thicker than the URDF, which the log does not favour by 20 to 1: "
    "{} of the smallest second moment"
)
MOST = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleSettings(ResultChoices):
    """Settings of `symgen sample`."""

    options = "count to out robot overwrite"
    count: int = output_field(100, metavar="N", help="Number of models.")
    to: str = output_field(
        "mjcf",
        metavar="A,B,…",
        autocompletion=completing((*EXPORT_FORMATS, *sampled_models.RANDOMISERS)),
        help="Formats with commas, such as mjcf,urdf, and files that a training run imports: "
        "playground, mjlab, isaaclab, json.",
    )
    seed: Seed = 0
    out: Path | None = output_field(metavar="DIR", help="Folder of files; default RESULT/samples.")
    overwrite: Overwrite = False


def sample_command(given: SampleSettings) -> None:
    r"""Draw models from the posterior of an identification.

    \b
    symgen sample results/fr3_simulated-map --count 10
    symgen sample results/first-map --count 1000 --to mjcf --settings seed=1
    symgen sample results/first-map --count 20 --to mjcf,urdf --out robots/plausible
    symgen sample results/first-map --count 1000 --to playground

    Each draw has its own masses, centres of mass, inertias, friction and rotor inertias, with the
    correlations that the log leaves between them, and is physically consistent. Train a controller
    on all of them to make it robust against what the identification does not know.

    Every model file is read again by the program that it is meant for. samples.json lists the
    files and the factors of each draw relative to the result, samples.npz π and φ.
    """
    if not 1 <= given.count <= MOST:
        raise IdentificationError(
            f"expected --count from 1 to {MOST}, got {given.count}; correct it"
        )
    formats = EXPORT_FORMATS.records()
    names = tuple(each.name for each in formats if each.holds_inertia and not each.is_folder)
    chosen = listed(given.to, (*names, *sampled_models.RANDOMISERS), "--to")
    kinds = tuple(kind for kind in chosen if kind in names)
    randomisers = tuple(kind for kind in chosen if kind in sampled_models.RANDOMISERS)
    folder = given.out or folder_of(given.result) / "samples"
    further = sampled_models.randomiser_paths(folder, randomisers)
    paths = [*sampled_models.sample_paths(folder, given.count, kinds), *further]
    written = ResultFolder(tuple(path.name for path in paths), "factors")
    written.require(folder, given, given.overwrite)
    saved, lib, notes = open_result(given, given.result, free_base=True, same_bodies=True)
    posterior = read_posterior(given.result, saved, lib)
    rng = np.random.default_rng(given.seed)
    with console.status("drawing models"):
        draws = draw_models(lib, saved, posterior, given.count, rng)
    with console.status("writing models"):
        written.begin(folder, given)
        facts = sampled_models.write_samples(lib, saved, draws, kinds, folder, given.seed)
        if randomisers:
            sampled_models.write_randomisers(lib, saved, draws, randomisers, folder, rng)
    say(
        f"{given.count} models, effective sample size {facts['effective_sample_size']:.0f}; "
        f"{100 * draws.acceptance:.0f} % of the trajectories were accepted"
    )
    for kind, sentence in facts["checks"].items():
        say(f"{kind}: {sentence}")
    thick = zip(lib.link_names, draws.thickened, strict=True)
    if raised := [f"{name} × {significant(float(by))}" for name, by in thick if by > 1.01]:
        notes = (*notes, THICKENED.format(", ".join(raised)))
    say_notes(notes)
    names_of_files = [str(folder / sampled_models.TABLE), *(path.name for path in further)]
    say(f"files: {', '.join(names_of_files)}")


def _list_formats(wanted: bool) -> None:
    if wanted:
        for each in EXPORT_FORMATS.records():
            say(f"{each.name}: {each.sentence}")
        raise typer.Exit


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportSettings(ResultChoices):
    """Settings of `symgen export`."""

    options = "to out robot overwrite formats"
    to: str | None = output_field(
        metavar="A,B,…",
        autocompletion=completing(EXPORT_FORMATS),
        help=f"Formats with commas, of {', '.join(EXPORT_FORMATS)}; default all.",
    )
    out: Path | None = output_field(
        metavar="FOLDER", help="Folder of the files; default RESULT/export."
    )
    overwrite: bool = output_field(False, help="Replace existing files.")
    formats: bool = output_field(
        False, callback=_list_formats, is_eager=True, help="List the formats and exit."
    )


def export_command(given: ExportSettings) -> None:
    r"""Export an identified model to simulators and controllers.

    \b
    symgen export results/fr3_simulated-map
    symgen export results/log-map --to urdf,mjcf --out robots/mine

    Each file is read again by a program that it is meant for. It is kept where that program
    gives the torques of the library at 1000 random states. `--formats` lists the formats;
    casadi is written only where it is named.
    """
    kinds = listed(given.to, tuple(EXPORT_FORMATS), "--to") if given.to else usual_formats()
    saved, lib, notes = open_result(given, given.result, True, free_base=True, same_bodies=True)
    folder = given.out or given.result / "export"
    done = export(saved, folder, kinds, lib, overwrite=given.overwrite)
    for each in done:
        say(f"{each.kind}: {f'{each.path} ({each.sentence})' if each.path else each.sentence}")
    say_notes(notes)
    if springs := springs_left_out(lib):
        say(f"note: {springs}")
    if saved.learned is not None:
        say(
            f"note: friction that {saved.record.method} learned has no counterpart in these formats"
        )
    failed = [each.kind for each in done if each.path is None]
    # A result without friction has no file of friction; that is a failure only where --to names it.
    if failed and (given.to or not all(each.is_optional for each in done if each.path is None)):
        raise ExportError(f"{len(failed)} of {len(done)} not written: {', '.join(failed)}")
