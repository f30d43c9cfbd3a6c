"""Fixtures of the run-time tests that attacks use, too."""

from tests.runtime.conftest import (  # noqa: F401
    clean,
    command,
    desk,
    lib,
    log,
    noisy,
    pi_true,
    trajectories,
)
