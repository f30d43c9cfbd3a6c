"""Virtual walking logs: feet on the ground stand still, their forces carry the robot."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from tests.walking_logs import G1, GO2, Gait, walking_log

MODELS = Path(pinocchio.__file__).parents[4] / "share/example-robot-data/robots"
GO2_FILE = MODELS / "go2_description/urdf/go2.urdf"


def test_feet_out_of_reach_are_refused() -> None:
    """Property: a log whose feet do not stand where the gait says is no log."""
    with pytest.raises(ValueError, match="out of reach"):
        walking_log(GO2_FILE.read_text(), replace(GO2, seconds=1.2, speed=0.5), 0)


@pytest.mark.parametrize(
    ("path", "gait"),
    [("go2_description/urdf/go2.urdf", GO2), ("g1_description/urdf/g1_29dof_rev_1_0.urdf", G1)],
)
def test_feet_on_the_ground_stand_still(path: str, gait: Gait) -> None:
    """Oracle: Pinocchio's kinematics of the logged encoders and attitude."""
    text = (MODELS / path).read_text()
    log = walking_log(text, replace(gait, seconds=1.2), 0)
    model = pinocchio.buildModelFromXML(text, pinocchio.JointModelFreeFlyer())
    data, arrays = model.createData(), log.arrays
    places = []
    for q, rpy in zip(arrays["q"], arrays["base_rpy"], strict=True):
        turn = pinocchio.Quaternion(pinocchio.rpy.rpyToMatrix(*rpy)).coeffs()
        pinocchio.framesForwardKinematics(model, data, np.concatenate([np.zeros(3), turn, q]))
        frames = [data.oMf[model.getFrameId(foot, pinocchio.BODY)] for foot in gait.feet]
        places.append([frame.act(np.array(gait.contact)) for frame in frames])
    place = np.array(places)
    both = log.touching[:, 0] & log.touching[:, 1]
    # Of feet on the ground only, the distance is that of their places there: to sensor noise,
    # 1e-4 rad of encoders and 1e-3 rad of the attitude at up to a metre.
    apart = (place[:, 0] - place[:, 1])[both]
    first, last = np.flatnonzero(both)[[0, -1]]
    still = np.flatnonzero(np.diff(np.flatnonzero(both)) > 1)
    steady = apart[: still[0] + 1] if still.size else apart
    assert np.abs(steady - steady.mean(axis=0)).max() < 6e-3
    assert last > first
    lowest = place[..., 2].min(axis=1)
    assert (place[..., 2] - lowest[:, None])[~log.touching].max() > 0.5 * gait.lift
    assert np.abs((place[..., 2] - lowest[:, None])[log.touching]).max() < 6e-3
    assert log.feasible > 0.8
