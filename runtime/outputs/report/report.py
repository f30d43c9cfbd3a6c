"""Result folder → `report.html`: one file without network access, reproducible byte for byte.

`result` reads and checks, `sections` makes sentences and tables, `figures` draws, `page` renders.
A comparison of methods in the folder is appended; without `result.json` it is the whole page.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

from runtime.common.terminal import as_typed
from runtime.errors import ExportError
from runtime.outputs.report.comparison import comparison_page, method_sections, read_methods
from runtime.outputs.report.page import Page, write_page
from runtime.outputs.report.result import Result, read_result
from runtime.outputs.report.sections import GLOSSARY, headline, sections, tiles
from runtime.registry import Registry


@dataclass(frozen=True, slots=True, eq=False)
class ReportKind:
    """Folders with results of another kind, which have a page of their own.

    Attributes:
        name: what wrote the folder.
        accepts: whether a folder has such results.
        pictures: files that `write` would write into a folder of figures.
        write: the page, and tables and figures where requested; the files.
    """

    name: str
    accepts: Callable[[Path], bool]
    pictures: Callable[[Path, Path], tuple[Path, ...]]
    write: Callable[..., tuple[Path, ...]]


REPORT_KINDS = Registry(
    "symgen.reports",
    ReportKind,
    "kind of results",
    {"experiments": "runtime.experiments.report:EXPERIMENTS"},
)


def write_report(folder: str | PathLike[str], out: str | PathLike[str] | None = None) -> Path:
    """Write `report.html` from the files of a result folder.

    Args:
        folder: output folder of an identification (`result.json` and `predictions.npz`), of a
            comparison (`compare.json`), or both.
        out: file to write; default `report.html` in the folder.

    Returns:
        Path of the report.

    Raises:
        RuntimeFault: a file is missing or damaged, or the report cannot be written.
    """
    if not isinstance(folder, str | PathLike):
        raise ExportError(f"expected the folder of a result, got {folder!r:.60}")
    folder = Path(folder)
    methods = read_methods(folder)
    if methods is not None and not (folder / "result.json").exists():
        shown = comparison_page(methods)
    else:
        shown = _page(read_result(folder))
        if methods is not None:
            shown = replace(shown, sections=(*shown.sections, *method_sections(methods)))
    return write_page(shown, folder / "report.html" if out is None else Path(out))


def _page(result: Result) -> Page:
    record = result.record
    name = record.recording.name or "unnamed recording"
    return Page(
        title=f"{record.robot}, {record.method}: identification report",
        subtitle=f"{record.robot} · method {record.method} · {name}",
        headline=headline(record),
        status=record.status or "",
        warnings=tuple(map(as_typed, record.doubts)),
        notes=tuple(as_typed(each) for each in record.warnings if each not in record.doubts),
        tiles=tiles(record),
        sections=sections(result),
        glossary=GLOSSARY,
    )
