"""Left and right side of a robot with mirrored limbs: drives and masses beside each other.

    Δ = x_left − x_right,   z² = Δᵀ (C_left + C_right)⁻¹ Δ  ≤  χ²_m(95 %)

Armature is one number, friction the pair of viscous and Coulomb friction, which a motion often
separates badly and whose covariance counts. Where the sides disagree, the drive of one side
predicts the held-out torque of the other: an error that rises belongs to the robot, one that does
not to intervals that are too narrow. The covariance between the sides is not counted.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.special import chdtri

from runtime.errors import IdentificationError
from runtime.estimators.regression.residuals import NORMAL_95
from runtime.estimators.regression.samples import samples_of
from runtime.identification.drive.result import DriveFit, places_of
from runtime.identification.identified import Identification
from runtime.library import Array

FRICTION = ("viscous", "coulomb")
RISES = 1.05
"""Error with the drive of the other side over that with the joint's, from which on they differ."""


class MirroredDrive(NamedTuple):
    """One quantity of two mirrored joints.

    Attributes:
        left: name of the left joint.
        right: name of the right joint.
        quantity: "armature" or "friction".
        values: left and right, (2, m).
        sigmas: of them, (2, m).
        distance: z.
        agrees: whether z is within the 95 % interval of no difference.
        rise: error of the held-out torque of both joints with the drive of the other side over that
            with their drives; None where the sides agree.
    """

    left: str
    right: str
    quantity: str
    values: Array
    sigmas: Array
    distance: float
    agrees: bool
    rise: float | None = None

    def sentence(self) -> str:
        """Where the sides disagree, and why."""
        sizes = [
            " and ".join(f"{v:.3g} ± {NORMAL_95 * s:.2g}" for v, s in zip(*each, strict=True))
            for each in zip(self.values, self.sigmas, strict=True)
        ]
        why = (
            "the error is hardly larger with the drive of the other side, so that the motion does "
            "not show which is right, and the intervals are too narrow"
            if self.rise is not None and self.rise < RISES
            else f"with the drive of the other side the error of the held-out rows is "
            f"{self.rise or np.nan:.2f} times as large: the two drives differ"
        )
        return (
            f"{self.quantity} of {self.left} ({sizes[0]}) and {self.right} ({sizes[1]}) differ by "
            f"{self.distance:.1f} standard deviations; {why}"
        )

    def facts(self) -> dict[str, Any]:
        """Entry of `symmetric` in result.json."""
        return {
            "left": self.left,
            "right": self.right,
            "quantity": self.quantity,
            "values": self.values.tolist(),
            "sigma": self.sigmas.tolist(),
            "distance": self.distance,
            "agrees": self.agrees,
            "rise": self.rise,
            "sentence": None if self.agrees else self.sentence(),
        }


def mirrored_joints(names: tuple[str, ...], pairs: tuple[str, ...]) -> tuple[tuple[int, int], ...]:
    """Joints whose names differ in one part."""
    places = []
    for text in pairs:
        left, mark, right = text.partition(":")
        if not (left and mark and right) or left == right:
            raise IdentificationError(
                f"--symmetric needs two parts of joint names, such as left:right, got '{text}'"
            )
        partners = [
            (i, names.index(name.replace(left, right, 1)))
            for i, name in enumerate(names)
            if left in name and name.replace(left, right, 1) in names
        ]
        if not partners:
            raise IdentificationError(
                f"--symmetric {text}: no joint with '{left}' has one with '{right}' in its place; "
                f"the joints are {', '.join(names)}"
            )
        places += partners
    return tuple(dict.fromkeys(places))


def with_sides(result: Identification, pairs: tuple[str, ...]) -> Identification:
    """The result with its sides compared, and a note per pair that disagrees."""
    places = mirrored_joints(result.lib.joint_names, pairs)
    drive = result.drive
    if drive is None:
        raise IdentificationError(
            "--symmetric compares drives with their standard deviations, which this identification "
            "does not have; give --delay auto, or a log with a commanded torque"
        )
    places_of_keys = places_of(result.friction.columns)
    sets = {"armature": ("armature",), "friction": FRICTION}
    kept = {
        name: [places_of_keys[key] for key in keys if key in places_of_keys]
        for name, keys in sets.items()
    }
    compared = tuple(
        each
        for pair in places
        for name, taken in kept.items()
        if taken and (each := _compared(result, drive, pair, name, taken)) is not None
    )
    differ = [each for each in compared if not each.agrees]
    note = (
        f"left and right agree within their 95 % intervals in {len(compared) - len(differ)} of "
        f"{len(compared)} pairs of armature and friction"
    )
    notes = (note, *(each.sentence() for each in differ), *result.notes)
    return replace(result, symmetric=compared, notes=notes)


def _compared(
    result: Identification, drive: DriveFit, pair: tuple[int, int], name: str, taken: list[int]
) -> MirroredDrive | None:
    """The comparison; None where a value is not determined."""
    values = result.phi[np.ix_(pair, taken)]
    sigmas = drive.phi_sigma[np.ix_(pair, taken)]
    if not np.isfinite(sigmas).all():
        return None
    spread = sum(drive.phi_covariance[j][np.ix_(taken, taken)] for j in pair)
    difference = values[0] - values[1]
    squared = float(difference @ np.linalg.pinv(np.asarray(spread)) @ difference)
    agrees = squared <= chdtri(len(taken), 0.05)
    names = result.lib.joint_names
    rise = None if agrees else _rise(result, pair, taken)
    return MirroredDrive(
        names[pair[0]], names[pair[1]], name, values, sigmas, squared**0.5, agrees, rise
    )


def _rise(result: Identification, pair: tuple[int, int], taken: list[int]) -> float:
    """Error of the test torque of two joints with exchanged drives, over that with theirs."""
    samples = samples_of(result.test, result.lib)
    exchanged = result.phi.copy()
    exchanged[np.ix_(pair, taken)] = result.phi[np.ix_(pair[::-1], taken)]
    rigid = samples.tau - samples.rigid(result.lib, result.pi)
    errors = [
        float(np.linalg.norm((rigid - samples.friction(phi))[:, list(pair)]))
        for phi in (exchanged, result.phi)
    ]
    return errors[0] / max(errors[1], 1e-300)
