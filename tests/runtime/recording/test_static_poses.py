"""Pairs of rests that reach one pose from both sides."""

import time

import numpy as np

from runtime.recording import Recording
from runtime.recording.static_poses import static_poses

ROWS_PER_REST, MOVING = 50, 12


def held(poses: int, rng: np.random.Generator) -> tuple[Recording, np.ndarray]:
    """A table of held poses at 20 Hz, each reached from both sides, the second visits shuffled."""
    base = rng.uniform(-1.0, 1.0, (poses, 6))
    visits = [(each, side) for side in (1.0, -1.0) for each in rng.permutation(base)]
    rests = []
    for pose, side in visits:
        approach = pose - 0.3 * side * np.linspace(1.0, 0.0, MOVING)[:, None]
        rests += [approach, np.repeat(pose[None], ROWS_PER_REST - MOVING, axis=0)]
    q = np.concatenate(rests)
    return Recording(0.05 * np.arange(len(q)), q, tau=np.sin(q)), base


def test_every_pose_has_its_pair_in_any_order() -> None:
    """Oracle: the poses that were drawn, whose torque is the mean of both visits."""
    log, base = held(40, np.random.default_rng(0))
    pairs = static_poses(log)
    assert pairs is not None
    distance = np.abs(pairs.q[:, None] - base[None]).max(axis=2).min(axis=1)
    assert len(pairs) == len(base)
    assert distance.max() < 1e-9


def test_many_poses_take_no_time() -> None:
    """Property: 1474 pairs of 147,400 rows; all pairs of rests one by one take minutes."""
    log, _ = held(1474, np.random.default_rng(1))
    begin = time.process_time()
    pairs = static_poses(log)
    assert time.process_time() - begin < 2.0
    assert pairs is not None
    assert len(pairs) == 1474
