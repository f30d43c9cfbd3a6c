"""Ctrl-C during computations of CasADi.

CasADi converts arguments by functions in Python, which it calls from C++ and whose exceptions it
discards: a KeyboardInterrupt that is raised there is lost, or ends as a SystemError.
"""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

AGAIN_S = 0.002
"""Time after which an interrupt within CasADi is repeated, s."""


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
