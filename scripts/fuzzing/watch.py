"""Audit of readers: starting processes, connecting, writing, removing, opening the canary."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scripts.fuzzing.mutators import CANARY

FORBIDDEN = (
    *("os.system", "os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.spawn", "os.symlink"),
    *("subprocess.Popen", "pickle.find_class", "socket.connect", "socket.bind", "pty.spawn"),
    *("os.link", "os.chmod", "webbrowser.open"),
)
CHANGING = ("os.remove", "os.rename", "os.rmdir", "os.mkdir", "shutil.rmtree")
TEMPTING = ("/etc/passwd", "/dev/zero", "/dev/stdin", CANARY)
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


class Watch:
    """Records the interpreter's audit events while it is armed.

    Attributes:
        seen: what was forbidden.
        allowed: folders in which files may be made and removed.
        programs: that may be started.
    """

    def __init__(self, allowed: Sequence[Path]) -> None:
        self.armed = False
        self.seen: list[str] = []
        self.programs: tuple[str, ...] = ()
        self.allowed = tuple(str(folder) for folder in allowed)
        sys.addaudithook(self._hear)

    def _hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.armed or (event == "subprocess.Popen" and arguments[0] in self.programs):
            return
        if event in FORBIDDEN or (event in CHANGING and not self._is_allowed(arguments)):
            self.seen.append(f"{event} {arguments!r:.200}")
        elif event == "open":
            name, _, flags = arguments
            writes = isinstance(flags, int) and flags & WRITING and name != os.devnull
            if (writes and not self._is_allowed((name,))) or str(name).endswith(TEMPTING):
                self.seen.append(f"open {arguments!r:.200}")

    def _is_allowed(self, arguments: tuple[Any, ...]) -> bool:
        """All names lie in allowed folders, or in a folder that is being removed and is open."""
        names = [str(each) for each in arguments if isinstance(each, str | os.PathLike)]
        inside = all(name.startswith(self.allowed) for name in names)
        by_folder = any(isinstance(each, int) and each >= 0 for each in arguments[1:2])
        return inside or (by_folder and "/" not in "".join(names))
