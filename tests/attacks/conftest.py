"""Fixtures of the run-time tests that attacks use, too."""

from tests.runtime.conftest import clean, command, desk, lib, log, noisy, pi_true, trajectories  # noqa: F401
