"""Ctrl-C while CasADi computes."""

import signal
import threading
import time

import casadi
import pytest

from symgen.cli import lasting_interrupts

CALLBACK = """
def callback(press):
    try:
        press()
    except BaseException:
        pass
"""


def callback_of_casadi():
    """A function of CasADi's files that discards exceptions, as its C++ does."""
    names: dict = {}
    exec(compile(CALLBACK, casadi.__file__, "exec"), names)  # noqa: S102
    return names["callback"]


def test_ctrl_c_within_casadi_is_not_lost() -> None:
    """Property: an interrupt that CasADi would discard is raised after its call."""
    callback, after = callback_of_casadi(), []

    def work() -> None:
        with lasting_interrupts():
            callback(lambda: signal.raise_signal(signal.SIGINT))
            after.append(True)
            time.sleep(5.0)  # the signal ends it

    with pytest.raises(KeyboardInterrupt):
        work()
    assert after == [True]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_elsewhere_is_raised_at_once() -> None:
    """Property: between calls of CasADi nothing is delayed."""

    def work() -> None:
        with lasting_interrupts():
            signal.raise_signal(signal.SIGINT)
            raise AssertionError

    with pytest.raises(KeyboardInterrupt):
        work()


def test_an_ignored_ctrl_c_stays_ignored() -> None:
    """Property: a process that ignores Ctrl-C, and other threads, keep their handlers."""
    usual = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with lasting_interrupts():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, usual)
    ends = []

    def work() -> None:
        with lasting_interrupts():
            ends.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert ends == [usual]
