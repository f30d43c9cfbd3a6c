"""`symgen export`."""

from dataclasses import dataclass
from pathlib import Path

import typer

from runtime.cli.common import listed
from runtime.cli.log_options import ResultChoices, open_result
from runtime.common.settings import output_field
from runtime.common.terminal import completing, say, say_notes
from runtime.errors import ExportError
from runtime.outputs.model_files.export import export
from runtime.outputs.model_files.export_format import EXPORT_FORMATS, usual_formats
from runtime.outputs.model_files.model import springs_left_out


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
    overwrite: bool = output_field(False, "--overwrite", help="Replace existing files.")
    formats: bool = output_field(
        False, "--formats", callback=_list_formats, is_eager=True, help="List the formats and exit."
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
