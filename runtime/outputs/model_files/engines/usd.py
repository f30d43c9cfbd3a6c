"""Read USD by usd-core: bodies of the links, placements and friction of the joints."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from runtime.library import Array
from runtime.outputs.model_files.engines.answer import Unreadable
from runtime.outputs.model_files.model import IdentifiedModel
from runtime.outputs.model_files.urdf_tree import RigidBody

INSTALL = "pip install 'symgen[export]'"
SINGLE = 1e-6  # of single-precision attributes, relative: two roundings to 24 bits and the degrees
_PER_DEGREE = 180 / np.pi
_AXIS = "physxJointAxis:{axis}"
TERMS = {  # quantity of a joint → its attribute for MuJoCo and those for PhysX
    "armature": ("mjc:armature", ("physxJoint:armature", f"{_AXIS}:armature")),
    "friction": (
        "mjc:frictionloss",
        (f"{_AXIS}:staticFrictionEffort", f"{_AXIS}:dynamicFrictionEffort"),
    ),
    "damping": ("mjc:damping", (f"{_AXIS}:viscousFrictionCoefficient",)),
}


@dataclass(frozen=True, slots=True)
class ReloadedStage:
    """A robot as usd-core read it from a stage."""

    engine: str  # name and version
    bodies: Array  # (n, 4, 4) pseudo-inertias; fixed bodies are in that of the moving link
    joints: dict[str, Any]  # name of a joint → its prim
    stage: Any  # to which the prims belong; they expire with it

    def place_error(self, name: str, placement: Array, axis: Array | None) -> float:
        """Largest difference of the placement of a joint, and of its axis."""
        prim = self.joints.get(name)
        if prim is None:
            return np.inf
        first, second = (_frame(prim, k) for k in (0, 1))
        error = float(np.abs(first @ np.linalg.inv(second) - placement).max())
        if axis is not None:
            error = max(error, float(np.abs(second[:3, 0] - axis).max()))
        return error

    def loop_error(self, name: str, frames: tuple[Array, Array]) -> float:
        """Largest difference of the two frames of a loop joint."""
        prim = self.joints.get(name)
        if prim is None or not prim.GetAttribute("physics:excludeFromArticulation").Get():
            return np.inf
        return max(float(np.abs(_frame(prim, k) - frames[k]).max()) for k in (0, 1))

    def follows(self, name: str, master: str, factor: float, offset: float) -> bool:
        """Whether a joint follows another, x = f x_m + o, in single precision."""
        prim, key = self.joints[name], "physxMimicJoint:rotX"
        gearing = prim.GetAttribute(f"{key}:gearing").Get()
        shift = prim.GetAttribute(f"{key}:offset").Get()
        (target,) = prim.GetRelationship(f"{key}:referenceJoint").GetTargets() or (None,)
        if prim.GetTypeName() == "PhysicsRevoluteJoint":
            shift = shift / _PER_DEGREE
        error = max(abs(gearing + factor), abs(shift + offset))
        limit = SINGLE * max(1.0, abs(factor), abs(offset))
        return bool(target == self.joints[master].GetPath() and error <= limit)

    def holds(self, name: str, quantity: str, value: float) -> bool:
        """Whether a joint has a value for MuJoCo in double and for PhysX in single precision."""
        prim = self.joints[name]
        is_angular = prim.GetTypeName() == "PhysicsRevoluteJoint"
        mjc, (*_, physx) = TERMS[quantity]
        physx = physx.format(axis="angular" if is_angular else "linear")
        scale = _PER_DEGREE if quantity == "damping" and is_angular else 1.0
        single = scale * float(prim.GetAttribute(physx).Get())
        return bool(prim.GetAttribute(mjc).Get() == value and abs(single - value) <= SINGLE * value)


def reload(text: str, model: IdentifiedModel) -> ReloadedStage | None:
    """Read a stage."""
    try:
        from pxr import Sdf, Tf, Usd
    except ImportError:
        return None
    layer = Sdf.Layer.CreateAnonymous(".usda")
    try:
        layer.ImportFromString(text)
    except Tf.ErrorException as error:
        raise Unreadable(error) from None
    stage = Usd.Stage.Open(layer)
    named: dict[str, Any] = {}
    joints: dict[str, Any] = {}
    for prim in stage.Traverse():
        name = prim.GetAttribute("symgen:name")
        if name:
            (joints if prim.GetTypeName().endswith("Joint") else named)[name.Get()] = prim
    lib, tree = model.lib, model.tree
    P = dict.fromkeys(lib.link_names, np.zeros((4, 4)))
    missing = [link for link in tree.links if link not in named]
    if missing:
        raise Unreadable(f"expected the link '{missing[0]}', which is missing")
    for link in tree.links:
        carrier, T = tree.carrier(link)
        body = _body(named[link])
        if carrier is not None and body is not None:
            P[carrier] = P[carrier] + T @ body.pseudo_inertia @ T.T
    version = ".".join(map(str, Usd.GetVersion()))
    return ReloadedStage(f"usd-core {version}", np.array(list(P.values())), joints, stage)


def _body(prim: Any) -> RigidBody | None:
    mass = prim.GetAttribute("symgen:mass")
    if not mass:
        return None
    values = (prim.GetAttribute(f"symgen:{k}").Get() for k in ("centerOfMass", "diagonalInertia"))
    com, diagonal = (np.array(value, dtype=float) for value in values)
    R = _rotation(prim.GetAttribute("symgen:principalAxes").Get())
    return RigidBody(float(mass.Get()), com, R @ np.diag(diagonal) @ R.T)


def _frame(prim: Any, side: int) -> Array:
    T = np.eye(4)
    T[:3, :3] = _rotation(prim.GetAttribute(f"physics:localRot{side}").Get())
    T[:3, 3] = prim.GetAttribute(f"physics:localPos{side}").Get()
    return T


def _rotation(quaternion: Any) -> Array:
    x, y, z = quaternion.GetImaginary()
    return np.asarray(Rotation.from_quat([x, y, z, quaternion.GetReal()]).as_matrix())
