"""Commands of the build tool: build, check, clean, describe, inspect, list, proxies.

Ctrl-C: CasADi converts arguments by functions in Python, which it calls from C++ and whose
exceptions it discards: a KeyboardInterrupt that is raised there is lost, or ends as a SystemError.
"""

import shlex
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import typer

from runtime.common.commands import Commands, application, run
from symgen import __version__

BUILD_LIBRARIES = frozenset({"casadi", "pinocchio", "coal"})  # installed by the extra `build`
PURPOSES = {"inspect": "inspecting a robot model", "proxies": "fitting capsules to a robot"}
"""What needs them, by command; every other command writes the C code of a robot."""

AGAIN_S = 0.002  # time after which an interrupt within CasADi is repeated, s


class BuildCommands(Commands):
    """Commands that write the library of a robot."""

    package = "symgen"


app = application(
    BuildCommands,
    "Generate the rigid-body model of a robot arm as C and compile it: "
    "from a URDF to generated/NAME/.",
    __version__,
)


def main() -> None:
    """Run the command line of `python -m symgen`."""
    start(app)


def start(program: typer.Typer) -> None:
    """Run a program with commands of the build; a library that it lacks is named."""
    try:
        with lasting_interrupts():
            run(program, "symgen")
    except ModuleNotFoundError as error:
        name = (error.name or "").partition(".")[0]
        if name not in BUILD_LIBRARIES:
            raise
        work = PURPOSES.get(sys.argv[1], "writing the C code of a robot")
        sys.stderr.write(
            f"symgen: {work} needs the package {name}, which is not installed; run: "
            f"{installation('build')}\n"
        )
        raise SystemExit(2) from None


def installation(extra: str) -> str:
    """Command that installs an extra, in a clone from the clone: an index may lack the version."""
    clone = Path(__file__).resolve().parents[2]
    source = clone if (clone / "pyproject.toml").is_file() else "symgen"
    return f"pip install {'' if source == 'symgen' else '-e '}{shlex.quote(f'{source}[{extra}]')}"


@contextmanager
def lasting_interrupts() -> Iterator[None]:
    """Raise KeyboardInterrupt between calls of CasADi, never within one.

    Nothing changes in other threads than the main one, or where Ctrl-C is ignored.
    """
    is_main = threading.current_thread() is threading.main_thread()
    before = signal.getsignal(signal.SIGINT)
    can_repeat = hasattr(signal, "pthread_kill")  # Windows cannot
    if not is_main or not can_repeat or before is not signal.default_int_handler:
        yield
        return
    left = threading.Event()

    def repeat() -> None:
        if not left.wait(AGAIN_S):
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

    def interrupt(number: int, frame: FrameType | None) -> None:
        if _is_within_casadi(frame):
            threading.Thread(target=repeat, daemon=True).start()
            return
        signal.default_int_handler(number, frame)

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        left.set()
        signal.signal(signal.SIGINT, before)


def _is_within_casadi(frame: FrameType | None) -> bool:
    file = getattr(sys.modules.get("casadi"), "__file__", None)
    folder = str(Path(file).parent) if file else ""
    while folder and frame is not None:
        if frame.f_code.co_filename.startswith(folder):
            return True
        frame = frame.f_back
    return False
