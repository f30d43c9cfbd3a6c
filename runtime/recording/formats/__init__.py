"""Formats of log files: one record each, by the name of the layout that a recipe states."""

from pathlib import Path

from runtime.recording.formats.log_format import LogFormat
from runtime.registry import Registry

FORMATS = Registry(  # all log formats; packages add them by entry points of "symgen.log_formats"
    "symgen.log_formats",
    LogFormat,
    "layout",
    {
        "csv": "runtime.recording.formats.csv_format:CSV",
        "flat": "runtime.recording.formats.csv_format:FLAT",
        "npz": "runtime.recording.formats.npz_format:NPZ",
        "parquet": "runtime.recording.formats.parquet_format:PARQUET",
        "hdf5": "runtime.recording.formats.hdf5_format:HDF5",
        "lerobot": "runtime.recording.formats.lerobot_format:LEROBOT",
        "bag": "runtime.recording.formats.bag_format:BAG",
    },
)

FOLDERS = {"lerobot": "meta/info.json", "bag": "metadata.yaml"}
"""File that makes a folder one log, by the format of this package; known without its import."""


def format_of_suffix(name: str) -> LogFormat | None:
    """Format of a file by its suffix, None where no format has it."""
    name = name.lower()
    each = (FORMATS[known] for known in FORMATS)  # those behind the first match stay unimported
    return next((f for f in each if f.suffixes and name.endswith(f.suffixes)), None)


def format_of_folder(place: Path) -> LogFormat | None:
    """Format of a folder that is one log, such as a ROS 2 bag; None for any other place."""
    present = (name for name in FOLDERS if (place / FOLDERS[name]).is_file())
    of_plugins = (FORMATS[name] for name in FORMATS if name not in FORMATS.builtin)
    if (name := next(present, None)) is not None:
        return FORMATS[name]
    marked = (each for each in of_plugins if each.marker)
    return next((each for each in marked if (place / each.marker).is_file()), None)


def all_suffixes() -> tuple[str, ...]:
    """Suffixes of all formats."""
    return tuple(suffix for each in FORMATS.records() for suffix in each.suffixes)
