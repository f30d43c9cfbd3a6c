"""Mirrored links: the equations hold for mirror images, and only mirrored joints are tied."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from runtime.errors import IdentificationError
from runtime.identification.drive.symmetry import mirrored_links, with_mirrored_links
from runtime.library import Array, Library

MIRROR = np.diag([1.0, -1.0, 1.0])


def turned(axis: Array, angle: float) -> Array:
    """Rotation about a unit axis, by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@dataclass
class TwoLimbs:
    """Kinematics of a left and a right limb of one joint each; frames turned in any way."""

    axes: tuple[Array, Array]
    places: tuple[Array, Array]
    frames: tuple[Array, Array]
    joint_names: tuple[str, ...] = ("left_hip", "right_hip")
    name: str = "limbs"
    n_joints: int = 2
    floating: bool = False

    @property
    def manifest(self) -> Any:
        """Whether the base is free."""
        return SimpleNamespace(floating=self.floating)

    @property
    def n_links(self) -> int:
        """The limbs, and the link of a free base before them."""
        return 2 + self.floating

    @property
    def n_rows(self) -> int:
        """Coordinates, of a free base first."""
        return 2 + 6 * self.floating

    @property
    def pi0(self) -> Array:
        """Ten parameters of every link."""
        return np.zeros(10 * self.n_links)

    def link_poses(self, q: Array) -> Array:
        """Poses in the base, (N, links, 4, 4); a free base is at rest."""
        poses = np.zeros((len(q), self.n_links, 4, 4))
        for i, angles in enumerate(q[:, -2:]):
            for k, angle in enumerate(angles, start=self.floating):
                poses[i, k, :3, :3] = turned(self.axes[k - self.floating], angle)
                poses[i, k, :3, :3] @= self.frames[k - self.floating]
                poses[i, k, :3, 3] = self.places[k - self.floating]
        return poses


def limbs(rng: np.random.Generator, sign: float = 1.0, mirror: Array = MIRROR) -> TwoLimbs:
    """Limbs that mirror each other about a plane; the right joint may turn the other way."""
    axis, place = rng.normal(size=(2, 3))
    axis = axis / np.linalg.norm(axis)
    frames = tuple(np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2))
    frames = tuple(f * np.sign(np.linalg.det(f)) for f in frames)
    # A rotation about a becomes the opposite one about M a.
    return TwoLimbs((axis, -sign * mirror @ axis), (place, mirror @ place), cast(Any, frames))


def parameters(masses: Array, points: Array) -> Array:
    """π of point masses (k,) at points (k, 3) of a link."""
    inertia = sum(
        m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True)
    )
    entries = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return np.array([masses.sum(), *(masses @ points), *entries])


@pytest.mark.parametrize("floating", [False, True])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("across", range(3))
def test_equations_hold_for_mirrored_masses(sign: float, across: int, floating: bool) -> None:
    """Oracle: point masses, and their mirror images in the frame of the right link.

    Rounding: ten products of numbers of size 10.
    """
    rng = np.random.default_rng(0)
    mirror = np.diag(np.where(np.arange(3) == across, -1.0, 1.0))
    robot = limbs(rng, sign, mirror)
    robot.floating = floating
    masses, points = rng.uniform(0.1, 1.0, size=5), rng.normal(size=(5, 3))
    images = points @ robot.frames[0].T @ mirror @ robot.frames[1]
    base = np.ones(10 * floating)  # its parameters are in no equation
    pi = np.concatenate([base, parameters(masses, points), parameters(masses, images)])
    rows = mirrored_links(cast(Library, robot), ("left:right",))
    assert len(rows) == 10
    values = np.array([row.coefficients @ pi - row.value for row in rows])
    np.testing.assert_allclose(values, 0.0, atol=1e-12)
    other = np.concatenate([pi[:-10], parameters(masses, images + 0.1)])
    assert max(abs(row.coefficients @ other) for row in rows) > 1e-2


def test_joints_that_are_not_mirrored_are_refused() -> None:
    """Property: another axis or place is named; --settings tie=true alone asks for the pair."""
    robot = limbs(np.random.default_rng(1))
    robot.places = (robot.places[0], robot.places[1] + 0.05)
    with pytest.raises(IdentificationError, match="left_hip and right_hip to be mirrored"):
        mirrored_links(cast(Library, robot), ("left:right",))
    with pytest.raises(IdentificationError, match="--settings symmetric=LEFT:RIGHT"):
        with_mirrored_links(None, cast(Library, robot), (), True)
    assert with_mirrored_links(None, cast(Library, robot), ("left:right",), False) is None
