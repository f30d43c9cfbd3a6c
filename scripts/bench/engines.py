"""Torques, tip speeds and distances of a robot by Pinocchio and coal."""

import numpy as np
import pinocchio

from runtime.library import Array, Library
from tests.collision_oracle import capsule_of, pair_distances
from tests.oracle import pinocchio_model

TABLE = -0.2
"""Height of the table, m."""


class Engines:
    """Pinocchio's model of a robot, with the capsules of its links in coal."""

    def __init__(self, lib: Library) -> None:
        self.lib, self.model = lib, pinocchio_model(lib.urdf(), lib.gravity)
        self._data = self.model.createData()
        self._tip = self.model.getFrameId(lib.manifest.tip, pinocchio.BODY)
        self._placed = {p.name: (p.joint + 1, *capsule_of(p)) for p in lib.proxies}

    def torques(self, states: Array) -> Array:
        """Torques of states (3 or more, N, n), (N, n)."""
        rows = zip(*states[:3], strict=True)
        return np.array([pinocchio.rnea(self.model, self._data, *row) for row in rows])

    def tip_speeds(self, states: Array) -> Array:
        """Speeds of the tip, (N,) m/s."""
        speeds = []
        for q, dq in zip(*states[:2], strict=True):
            pinocchio.forwardKinematics(self.model, self._data, q, dq)
            v = pinocchio.getFrameVelocity(self.model, self._data, self._tip)
            speeds.append(np.linalg.norm(v.linear))
        return np.array(speeds)

    def distances(self, states: Array, pairs: list[tuple[str, str]]) -> Array:
        """Distance of every pair, (N, R) m; the second of a pair may be "table"."""
        return np.array(list(pair_distances(self.model, self._placed, TABLE, states[0], pairs)))
