"""python -m scripts.fuzzing.child JOB: reads damaged files within limits, one JSON line for each.

A line says which file begins, the next how it ended: read, refused, or the fault. A fault is an
exception or a warning that is not ours, a file left over, memory without bound, an opened canary, a
process or a connection begun.
"""

import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

from runtime.errors import RuntimeFault
from runtime.library import load
from scripts.bench.front import peak_memory
from scripts.fuzzing.damage import CANARY, Damaged, drawn
from scripts.fuzzing.doors import DOORS, OUT, Door
from symgen.errors import SymgenError

SECONDS = 20.0
"""Limit of processor time per file, s; a good report takes one second, other files milliseconds."""
PATIENCE = 300.0  # limit of wall time per file, s, for a reader that waits
MEMORY = 2**30  # bytes of address space beyond what the process has before it reads damaged files
RESIDENT = 4 * 10**8  # bytes of memory that one file may take; good ones take a few million

FORBIDDEN = (
    *("os.system", "os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.spawn", "os.symlink"),
    *("subprocess.Popen", "pickle.find_class", "socket.connect", "socket.bind", "pty.spawn"),
    *("os.link", "os.chmod", "webbrowser.open"),
)
CHANGING = ("os.remove", "os.rename", "os.rmdir", "os.mkdir", "shutil.rmtree")
TEMPTING = ("/etc/passwd", "/dev/zero", "/dev/stdin", CANARY)
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


class Watch:
    """Records what the interpreter audits while armed: processes, connections, files written."""

    def __init__(self, allowed: Sequence[Path]) -> None:
        self.armed = False
        self.seen: list[str] = []  # what was forbidden
        self.programs: tuple[str, ...] = ()  # that may be started
        self.allowed = tuple(str(folder) for folder in allowed)  # where files may be made, removed
        sys.addaudithook(self._hear)

    def _hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        starts = event in {"subprocess.Popen", "os.posix_spawn"}  # the latter from Python 3.13 on
        if not self.armed or (starts and arguments[0] in self.programs):
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


class Hang(BaseException):
    """The time limit of a file is exceeded."""


def main() -> None:
    """Work through the job: {robot, folder, seed, keep, work: [[kind, first, count], …]}."""
    job = json.loads(sys.argv[1])
    report = _only_ours()
    sys.dont_write_bytecode = True
    lib = load(job["robot"])
    root = Path(job["folder"])
    tempfile.tempdir = str(root / "tmp")
    (root / "tmp").mkdir(exist_ok=True)
    os.chdir(root / "tmp")  # files that libraries write to the working directory
    (root / CANARY).write_text("this file must not be read")
    watch = Watch((root / "tmp",))
    for number in (signal.SIGPROF, signal.SIGALRM):
        signal.signal(number, _over)
    for kind, first, count in job["work"]:
        door, folder = DOORS[kind], root / kind
        path = folder / door.file
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        door.furnish(folder, lib)
        watch.programs = door.programs
        watch.allowed = (str(root / "tmp"), str(folder / OUT))
        door.read(path, lib)  # a good file is read, and everything it needs is imported
        warnings.simplefilter("error", RuntimeWarning)
        shutil.rmtree(folder / OUT, ignore_errors=True)
        before = _files(folder, door)
        damaged = drawn(path.read_bytes(), door.file, (job["seed"], kind), first, count)
        for index, one in enumerate(damaged, first):
            report(begin=[kind, index])
            _put(one, path)
            if door.seal is not None:
                door.seal(folder)
            held, start = _resident(), time.process_time()
            outcome = _read(partial(door.read, path, lib), watch)
            seconds, grown = time.process_time() - start, peak_memory() - held
            if grown > RESIDENT and outcome in {"read", "refused"}:
                outcome = f"takes {grown / 1e6:.0f} MB"
            left = sorted(_files(folder, door) ^ before) + _remains(root, folder, outcome, door)
            if left:
                outcome, before = f"left or removed {left}", _files(folder, door)
            if outcome not in {"read", "refused"} and job.get("keep"):
                _keep(path, Path(job["keep"]), f"{kind}-{index}")
            shutil.rmtree(folder / OUT, ignore_errors=True)
            report(kind=kind, index=index, outcome=outcome, seconds=seconds, grown=grown)
        shutil.rmtree(folder, ignore_errors=True)


def _only_ours() -> Callable[..., None]:
    """Function that writes JSON lines; standard output of the commands is discarded."""
    output = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

    def report(**facts: Any) -> None:
        print(json.dumps(facts), file=output, flush=True)

    return report


def _put(one: Damaged, path: Path) -> None:
    """Put a damaged file, or something that is no file, into the place of a file."""
    clear(path)
    match one:
        case bytes():
            path.write_bytes(one)
        case "folder":
            path.mkdir()
        case "pipe":
            os.mkfifo(path)
        case "device":
            path.symlink_to("/dev/zero")
        case "itself" | "nowhere":
            path.symlink_to(path.name if one == "itself" else "nowhere")
        case "empty":
            path.write_bytes(b"")


def clear(path: Path) -> None:
    """Remove whatever is at a path."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _read(read: Callable[[], Any], watch: Watch) -> str:
    """Outcome: read, refused, or the fault."""
    watch.seen.clear()
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    _limit_memory(pages * resource.getpagesize() + MEMORY)
    watch.armed = True
    try:
        try:
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            signal.setitimer(signal.ITIMER_REAL, PATIENCE)
            read()
            outcome = "read"
        except (RuntimeFault, SymgenError):
            outcome = "refused"
        except Hang:
            outcome = f"hangs: no answer in {SECONDS} s\n{traceback.format_exc()[-600:]}"
        except BaseException:
            outcome = traceback.format_exc()[-1500:]
        finally:
            for timer in (signal.ITIMER_PROF, signal.ITIMER_REAL):
                signal.setitimer(timer, 0)
    except Hang:  # the alarm came when the reader had just ended
        outcome = "hangs: no answer in time"
    finally:
        _limit_memory(resource.RLIM_INFINITY)
        watch.armed = False
    return f"did {watch.seen[0]}" if watch.seen else outcome


def _over(_: int, __: FrameType | None) -> NoReturn:
    raise Hang


def _limit_memory(most: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _resident() -> int:
    """Resident bytes now; the peak is counted from here on."""
    Path("/proc/self/clear_refs").write_text("5")
    return peak_memory()


def _files(folder: Path, door: Door) -> set[str]:
    names = {str(path.relative_to(folder)) for path in folder.rglob("*")}
    return {name for name in names if name != door.file and name.split("/")[0] != OUT}


def _remains(root: Path, folder: Path, outcome: str, door: Door) -> list[str]:
    """Files left in the temporary folder, and files written by a command that refused."""
    left = list((root / "tmp").iterdir())
    for path in left:
        clear(path)
    if outcome == "refused":
        written = [path for path in (folder / OUT).rglob("*") if path.is_file()]
        left += [path for path in written if path.name not in door.offered]
    return [str(path.relative_to(root)) for path in left]


def _keep(path: Path, folder: Path, name: str) -> None:
    """A copy of the damaged file."""
    if path.is_file() and not path.is_symlink():
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, folder / f"{name}{''.join(path.suffixes)}")


if __name__ == "__main__":
    main()
