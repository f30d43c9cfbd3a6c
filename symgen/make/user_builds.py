"""Record of the libraries that this user has compiled, which the run time opens.

A compiled library runs as soon as it is opened. The run time opens only those whose SHA-256 stands
in the user's records: <folder>/<SHA-256>.json with `robot` and `folder`. The folder is
$SYMGEN_BUILDS, else that of the user's data.
"""

import json
import os
import tempfile
from contextlib import suppress
from pathlib import Path

import platformdirs

from symgen.documents import json_of


def record_build(robot: str, folder: Path, sha256: str) -> str:
    """Record that this user has compiled a library; records of deleted folders are removed."""
    records = records_folder()
    facts = {"robot": robot, "folder": str(folder.resolve())}
    try:
        records.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, draft = tempfile.mkstemp(prefix=".", suffix=".new", dir=records)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(json.dumps(facts) + "\n")
        os.replace(draft, records / f"{sha256}.json")
    except OSError as error:
        return (
            f"the build could not be recorded in '{records}' ({error.strerror}), so the run time "
            "compiles the C code once more; set SYMGEN_BUILDS to a folder that can be written"
        )
    for path in records.glob("*.json"):
        with suppress(OSError, ValueError, KeyError, TypeError):
            if not Path(json_of(path)["folder"]).exists():
                path.unlink(missing_ok=True)
    return ""


def is_recorded(sha256: str) -> bool:
    """Whether this user has compiled a library of these bytes."""
    return (records_folder() / f"{sha256}.json").is_file()


def records_folder() -> Path:
    """Folder of the records."""
    chosen = os.environ.get("SYMGEN_BUILDS", "")
    if chosen:
        return Path(chosen).expanduser().absolute()
    return platformdirs.user_data_path("symgen") / "builds"
