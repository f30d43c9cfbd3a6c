"""python -m scripts.fuzzing.child JOB: reads damaged files within limits, one JSON line for each.

A line says which file begins, the next how it ended: accepted, refused, or the fault. A fault is
an exception that is not ours, a file left over, an opened canary, a process or a connection begun.
"""

import json
import os
import resource
import shutil
import signal
import sys
import time
import traceback
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import numpy as np

from runtime.errors import RuntimeFault
from runtime.library import load
from scripts.fuzzing.doors import DOORS, furnish
from scripts.fuzzing.mutators import CANARY, mutated
from symgen.errors import SymgenError

SECONDS = 5.0
"""Of processor time per file, on any machine; a good file takes milliseconds."""
MEMORY = 2**30
"""Bytes of address space beyond what the process has before it reads damaged files."""
FORBIDDEN = (
    *("os.system", "os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.spawn", "os.symlink"),
    *("subprocess.Popen", "pickle.find_class", "socket.connect", "socket.bind", "pty.spawn"),
    *("os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.link", "os.chmod", "shutil.rmtree"),
)
TEMPTING = ("/etc/passwd", "/dev/zero", "/dev/stdin", CANARY)
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


class Hang(BaseException):
    """The time of a file is over."""


class Watch:
    """Notes what a reader has no reason to do, while it is armed."""

    def __init__(self) -> None:
        self.armed = False
        self.seen: list[str] = []
        sys.addaudithook(self._hear)

    def _hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.armed:
            return
        if event in FORBIDDEN:
            self.seen.append(f"{event} {arguments!r:.200}")
        elif event == "open":
            name, _, flags = arguments
            if (isinstance(flags, int) and flags & WRITING) or str(name).endswith(TEMPTING):
                self.seen.append(f"open {arguments!r:.200}")


def main() -> None:
    """Work through the job: {robot, folder, seed, work: [[kind, first, count], …]}."""
    job = json.loads(sys.argv[1])
    sys.dont_write_bytecode = True
    lib = load(job["robot"])
    root = Path(job["folder"])
    (root / CANARY).write_text("nobody reads this")
    watch = Watch()
    signal.signal(signal.SIGPROF, _over)
    for kind, first, count in job["work"]:
        door, folder = DOORS[kind], root / kind
        shutil.rmtree(folder, ignore_errors=True)
        furnish(kind, folder, lib)
        door.read(folder, lib)  # a good file is accepted, and everything it needs is imported
        good = (folder / door.file).read_bytes()
        _limit_memory()
        before = _files(folder)
        for index in range(first, first + count):
            rng = np.random.default_rng([job["seed"], sorted(DOORS).index(kind), index])
            data = mutated(good, Path(door.file).suffix, rng)
            (folder / door.file).write_bytes(data)
            _say(begin=[kind, index])
            held = _peak()
            start = time.process_time()
            outcome = _read(lambda door=door, folder=folder: door.read(folder, lib), watch)
            left = sorted(_files(folder) ^ before)
            if left:
                outcome = f"left or removed {left}"
                before = _files(folder)
            _say(
                kind=kind,
                index=index,
                outcome=outcome,
                seconds=time.process_time() - start,
                grown=_peak() - held,
            )


def _read(read: Any, watch: Watch) -> str:
    """What came of it: accepted, refused, or the fault."""
    watch.seen.clear()
    watch.armed = True
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        read()
        outcome = "accepted"
    except (RuntimeFault, SymgenError):
        outcome = "refused"
    except Hang:
        outcome = f"hangs: no answer in {SECONDS} s\n{traceback.format_exc()[-600:]}"
    except BaseException:
        outcome = traceback.format_exc()[-1500:]
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        watch.armed = False
    return f"did {watch.seen[0]}" if watch.seen else outcome


def _over(_: int, __: FrameType | None) -> NoReturn:
    raise Hang


def _limit_memory() -> None:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def _say(**facts: Any) -> None:
    print(json.dumps(facts), flush=True)


if __name__ == "__main__":
    main()
