"""Functions for CasADi, written and read again by a process of symgen."""

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any

import numpy as np

from runtime.common.child import ExceededError, Limits, answer_of
from runtime.errors import ExportError
from runtime.library import Array

WRITER = "symgen.make.casadi_files"
LIMITS = Limits(seconds=600, patience=900.0, memory=8 * 2**30, file=2**28)
"""Of the process; a robot of 30 joints takes a minute."""


def written(job: Mapping[str, Any]) -> dict[str, str]:
    """Files of a model by name."""
    if find_spec("casadi") is None or find_spec("symgen") is None:
        raise ExportError(
            "not written: expected CasADi, found none; run: pip install 'symgen[build]'"
        )
    try:
        texts = answer_of(WRITER, job, LIMITS)
    except ExceededError as error:
        raise ExportError(f"not written: the functions take more than {error}") from None
    if "error" in texts:
        raise ExportError(f"not written: {texts['error']}")
    return texts


def torques(text: str, *motion: Array) -> Array:
    """τ (N, n) of the function `torque` of a serialised file at q, dq and ddq (N, n)."""
    job = {"text": text, "motion": [each.T.tolist() for each in motion]}
    return np.transpose(answer_of(WRITER, job, LIMITS)["tau"])
