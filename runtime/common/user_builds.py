"""Libraries that `symgen build` of this user has made: the only compiled files that are opened.

A compiled library runs as soon as it is opened, and a folder from elsewhere may hold any library
beside a matching build.json. `symgen build` therefore writes one record per library,
<folder of records>/<SHA-256 of the library>.json with `robot` and `folder`. The folder of records
is $SYMGEN_BUILDS, else that of the user's data. Records that another user could have written do not
count.
"""

import json
import os
import re
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

import platformdirs

from runtime.common.files import json_of

NAME = re.compile(r"[a-z][a-z0-9_]*")  # name of a robot; any other word is the path of a folder
DEFAULT_ROOT = Path("generated")  # folder with one subfolder per robot


def is_safe_from_others(path: Path) -> bool:
    """Whether only this user, the administrator and the user's own group can change a path."""
    try:
        facts = path.lstat()
    except OSError:
        return False
    of_group = facts.st_mode & stat.S_IWGRP and facts.st_gid != os.getegid()
    return facts.st_uid in {os.getuid(), 0} and not (facts.st_mode & stat.S_IWOTH or of_group)


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


def is_user_build(library: Path, sha256: str) -> bool:
    """Whether this user compiled a library."""
    records = records_folder()
    return all(map(is_safe_from_others, (library.resolve(), records, records / f"{sha256}.json")))


def built_folders(robot: str) -> list[Path]:
    """Folders in which this user has built a robot of a name, the last build first."""
    return [folder for name, folder in _builds() if name == robot]


def built_robots() -> dict[str, Path]:
    """Names of all robots that this user has built → folder of the last build."""
    return dict(reversed(_builds()))


def generated_here(out: Path = DEFAULT_ROOT) -> list[Path]:
    """Generated folders of a place; of `DEFAULT_ROOT` those of the package and of this user too."""
    package = Path(__file__).parents[2]  # generated/ lies beside symgen, or in runtime if installed
    roots = [out]
    if out == DEFAULT_ROOT:
        roots += [package / "generated", package / "runtime" / "generated"]
    folders: dict[str, Path] = {}
    for root in roots:
        for folder in sorted(root.glob("[a-z]*/")):
            if (folder / "manifest.json").exists():
                folders.setdefault(folder.name, folder)
    others = built_robots() if out == DEFAULT_ROOT else {}
    return list((others | folders).values())


def _builds() -> list[tuple[str, Path]]:
    """Robot and folder of every build that still exists, the last one first."""
    records = records_folder()
    if not is_safe_from_others(records):
        return []
    builds = []
    for path in records.glob("*.json"):
        try:
            facts, written = json_of(path), path.stat().st_mtime
            if is_safe_from_others(path) and NAME.fullmatch(facts["robot"]):
                builds.append((written, str(facts["robot"]), Path(facts["folder"])))
        except (OSError, ValueError, KeyError, TypeError):
            continue  # a record that is being replaced, or a damaged one
    newest_first = dict.fromkeys((name, folder) for _, name, folder in sorted(builds, reverse=True))
    return [each for each in newest_first if (each[1] / "manifest.json").is_file()]


def records_folder() -> Path:
    """Folder of the records."""
    chosen = os.environ.get("SYMGEN_BUILDS", "")
    if chosen:
        return Path(chosen).expanduser().absolute()
    return platformdirs.user_data_path("symgen") / "builds"
