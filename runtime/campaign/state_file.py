"""state.json of a campaign: its settings, and the accuracy after every motion."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from runtime.errors import IdentificationError
from runtime.excitation import Safety
from runtime.files import DRAFT, json_of, replacing

STATE = "state.json"


def limits_facts(safety: Safety) -> dict[str, Any] | None:
    """Limits beyond those of the robot, JSON-ready; None where there are none."""
    usual = asdict(Safety())
    beyond = {key: value for key, value in asdict(safety).items() if value != usual[key]}
    facts: dict[str, Any] = json.loads(json.dumps(beyond))
    return facts or None


def opened_state(folder: Path, described: dict[str, Any]) -> dict[str, Any]:
    """Content of state.json; a new one where the folder has none."""
    path = folder / STATE
    if not path.exists():
        # Motions may be given; they are read and never replaced.
        known_names = ("motion-*.json", f"{DRAFT}*")
        if folder.is_dir() and not all(
            any(file.match(name) for name in known_names) for file in folder.iterdir()
        ):
            raise IdentificationError(
                f"'{folder}' has files and is no folder of a campaign; choose a new or empty one "
                "with --out"
            )
        _remove_drafts(folder)
        state: dict[str, Any] = described | {"motions": []}
        write_json(path, state)
        return state
    known = json_of(path)
    if not isinstance(known, dict) or any(known.get(key) != described[key] for key in described):
        raise IdentificationError(
            f"'{folder}' holds a campaign of another robot or with other settings; choose another "
            "folder with --out, or give the same settings"
        )
    _remove_drafts(folder)
    return known


def _remove_drafts(folder: Path) -> None:
    """Remove what a killed process was writing."""
    for draft in folder.rglob(f"{DRAFT}*"):
        draft.unlink(missing_ok=True)


def write_json(path: Path, facts: dict[str, Any]) -> None:
    """Write a file of a campaign, completely or not at all."""
    with replacing(path) as file:
        file.write(f"{json.dumps(facts, indent=1, ensure_ascii=False)}\n".encode())
