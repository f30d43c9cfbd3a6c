"""The page of the Python API for mkdocstrings: the names of runtime, the records of plug-ins."""

from pathlib import Path

import griffe

ROOT = Path(__file__).resolve().parents[2]
PAGE = "reference/api.md"
RECORDS = (
    "runtime.estimators.methods.Method",
    "runtime.recording.settings.FrictionColumn",
    "runtime.recording.formats.log_format.LogFormat",
    "runtime.excitation.search.criteria.Criterion",
    "runtime.excitation.motion.family.Basis",
    "runtime.excitation.motion_export.MotionFormat",
    "runtime.outputs.model_files.export_format.ExportFormat",
    "runtime.campaign.drivers.DriverKind",
)
"""What the registries hold, and a package with an entry point brings."""
TEXT = """# Python API

`import runtime` offers the names below; a name that is not here may change between versions.

::: runtime
    options:
      show_root_toc_entry: false
      show_root_heading: false
      heading_level: 2
      members: {names}

# Records of plug-ins

A package that adds a method, a friction column or a format brings one of these records
([Add your own](../plugins.md)).

{records}
"""


def markdown() -> str:
    """The page: the names that `runtime` exports, then the records."""
    read = griffe.load(
        "runtime", submodules=False, search_paths=[ROOT / "runtime"], allow_inspection=False
    )
    records = "\n\n".join(f"::: {name}" for name in RECORDS)
    return TEXT.format(names=read.exports, records=records)
