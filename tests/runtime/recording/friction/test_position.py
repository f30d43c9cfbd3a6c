"""The column `position`: friction that changes over the range of a joint."""

import warnings
from dataclasses import dataclass

import numpy as np
import pytest

from runtime.recording import Friction
from runtime.recording.friction.model import columns
from runtime.recording.settings import JointMotion


@dataclass
class _Limits:
    """Library of a joint with a range and of one that turns without end."""

    def limits(self) -> dict[str, np.ndarray]:
        return {"lower": np.array([-1.0, -np.inf]), "upper": np.array([3.0, np.inf])}


def test_a_joint_without_limits_changes_over_half_a_turn() -> None:
    """x = (q − 1)/2 within limits of −1 and 3, and q/π without limits, without a warning."""
    q, dq = np.array([[3.0, np.pi / 2]]), np.array([[5.0, 5.0]])
    motion = JointMotion(dq, q, None, _Limits())  # type: ignore[arg-type]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        values = columns(motion, Friction(("position",)))
    assert values.ravel() == pytest.approx([1.0, 0.5])  # tanh(5 / 0.02) is 1
