"""A folder of good files from which tests of bad input start, and what damages files."""

import hashlib
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime import Recording, write_recording
from runtime.library import Library

Words = tuple[object, ...]


@dataclass(frozen=True, slots=True)
class Desk:
    """A folder with a good log (`good.csv`, `good.npz`) and a good trajectory, and their robot."""

    folder: Path
    log: Recording
    lib: Library
    pendulum: Library

    def put(self, name: str, content: str | bytes) -> str:
        data = content.encode() if isinstance(content, str) else content
        (self.folder / name).write_bytes(data)
        return name

    def changed(self, **changes: Any) -> str:
        """A log that differs from the good one in some signals."""
        write_recording(self.log.replace(**changes), self.folder / "bad.csv")
        return "bad.csv"

    def rows(self, rows: slice) -> str:
        write_recording(self.log.take(rows, "cut"), self.folder / "bad.csv")
        return "bad.csv"

    def lines(self) -> list[str]:
        return (self.folder / "good.csv").read_text().splitlines()

    def identify(self, log: str, *words: object) -> Words:
        return ("identify", log, "--robot", self.lib.folder, "--out", "out", *words)

    def simulate(self, *words: object, robot: Library | None = None) -> Words:
        chosen = (robot or self.lib).folder
        motion = ("--trajectory", "good.json", "--out", "s.csv", "--ideal")
        return ("simulate", "--robot", chosen, *motion, *words)

    def excite(self, *words: object) -> Words:
        return (
            "excite",
            "--robot",
            self.lib.folder,
            "--settings",
            "starts=1",
            "--out",
            "e.json",
            *words,
        )

    def robot(self, damage: Callable[[Path], object]) -> Words:
        """identify with a copy of the robot's folder that was damaged."""
        copy = Path(shutil.copytree(self.lib.folder, self.folder / "robot"))
        damage(copy)
        return ("identify", "good.csv", "--robot", "./robot", "--out", "out")

    def trajectory(self, **changes: Any) -> Words:
        """simulate with a trajectory file that was changed."""
        path = self.folder / "good.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | changes))
        return self.simulate()


def digests(folder: Path) -> dict[str, str]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def truncate(path: Path, share: float = 0.5) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
