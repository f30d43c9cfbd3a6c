"""Two runs of the FR3, without and with a weighed payload, exact."""

import numpy as np
import pinocchio
import pytest

from runtime.identification.payload.body import mount_of
from tests.runtime.identification.sensor_gains.weighed import COM, INERTIA, WIDTH


@pytest.fixture(scope="module")
def payload_pi(lib):
    """π of the payload in link 7's frame, by Pinocchio."""
    tip = lib.manifest.tip_frame
    placement = pinocchio.SE3(np.array(tip.rotation), np.array(tip.translation))
    moved = placement.act(pinocchio.Inertia(3.0, COM, INERTIA)).toDynamicParameters()
    return moved[[0, 1, 2, 3, 4, 6, 9, 5, 7, 8]]  # Ixx Ixy Iyy Ixz Iyz Izz → xx yy zz xy xz yz


@pytest.fixture(scope="module")
def dense(ideal_runs, lib, payload_pi):
    """True torques of two motions at 100 Hz with friction, the second with the payload."""
    kept = ideal_runs[:2]
    Y = lib.regressor(kept[1].q, kept[1].dq, kept[1].ddq)[:, :, mount_of(lib).columns]
    rub = [0.5 * run.dq + 0.3 * np.tanh(run.dq / WIDTH) for run in kept]
    return (
        kept[0].replace(tau=kept[0].tau + rub[0], name="empty"),
        kept[1].replace(tau=kept[1].tau + rub[1] + Y @ payload_pi, name="loaded"),
    )


@pytest.fixture(scope="module")
def runs(dense):
    """The same at 50 Hz."""
    return tuple(run.take(slice(0, None, 2), "Every second row.") for run in dense)
