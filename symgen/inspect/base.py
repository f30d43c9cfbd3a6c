"""Base parameters of a file whatever its inertials: β = K T x, x the π of every link as written.

K depends on kinematics only, so every inertial is replaced by a unit body before `symgen.chain`
reads the file. T adds the links that are fixed together to the link that carries them.
"""

from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np

from symgen.chain import Chain, ChainOptions, read_chain
from symgen.chain.document import MOVING, Document, add_inertial, numbers
from symgen.errors import UrdfError
from symgen.inspect.model import Model, pi_of, pseudo_of
from symgen.kernel import Array
from symgen.mechanics import inertia
from symgen.mechanics.base_parameters import BaseParameters, numeric_base
from symgen.mechanics.combination import describe_combination
from symgen.mechanics.dynamics import sampled_regressor

SNAP = 1e-4  # error of rounded angles, rad, up to which the rank is decided on exact ones
EXACT = 1e-9  # distance from a multiple of π/2, rad, below which an angle has enough digits
MOST_JOINTS = 24  # largest number of moving joints; beyond it the symbolic regressor takes minutes
_STATES = 400  # random states for the condition number and the weights of torques
_P = inertia.N_PARAMETERS


@dataclass(frozen=True, slots=True, eq=False)
class SampledBase:
    """Identifiable parameters of a robot."""

    chain: Chain  # the kinematics; its inertials are unit bodies
    parameters: BaseParameters  # K and the rank decision
    rows: Array  # (N, n, n_b) Y_b at random states
    condition: float  # condition number of Y_b over those states, its columns normalised
    snapped: bool  # True if rounded angles had to be replaced by exact multiples of π/2

    @property
    def names(self) -> list[str]:
        """Each base parameter as a combination of link parameters."""
        names = [f"{j.link}.{p}" for j in self.chain.joints for p in inertia.PI_NAMES]
        return [describe_combination(names, list(row)) for row in self.parameters.matrix]

    def factor(self, beta: Array) -> Array:
        """R (n_b, n_b) with ‖R Δβ‖² = mean over states and joints of (Δτ_j / τ_rms,j)².

        A torque is weighted relative to that of its joint under β, else a wrist would not count.
        """
        rms = np.sqrt(np.mean((self.rows @ beta) ** 2, axis=0))  # (n,)
        weights = 1 / np.maximum(rms, 1e-3 * max(float(rms.max()), 1e-12))
        weighted = (self.rows * weights[None, :, None]).reshape(-1, len(beta))
        return np.linalg.qr(weighted, mode="r") / np.sqrt(len(weighted))


def base_of(text: str) -> SampledBase:
    """Rank and K of a URDF."""
    document = _unit_bodies(text)
    moving = sum(document.kind(name) in MOVING for name in document.joints)
    if moving > MOST_JOINTS:
        raise UrdfError(
            f"{moving} moving joints are more than {MOST_JOINTS}; inspect one arm at a time"
        )
    snapped = any(_is_rounded(element) for element in document.joints.values())
    chain = read_chain(document.text(), ChainOptions(snap=SNAP if snapped else 0.0))
    regressor = sampled_regressor(chain)
    parameters = numeric_base(chain, regressor)
    n, rng = len(chain.joints), np.random.default_rng(1)
    q = rng.uniform(-np.pi, np.pi, (_STATES, n))
    dq, ddq = rng.normal(0, 1, (_STATES, n)), rng.normal(0, 2, (_STATES, n))
    rows = regressor(q, dq, ddq)[:, :, list(parameters.columns)]
    flat = rows.reshape(-1, len(parameters.columns))
    # Columns of unit length: the condition of the directions, not of the units.
    sigma = np.linalg.svd(flat / np.linalg.norm(flat, axis=0), compute_uv=False)
    return SampledBase(chain, parameters, rows, float(sigma[0] / sigma[-1]), snapped)


def _is_rounded(joint: Element) -> bool:
    """True for angles such as 1.5708, with which the rank would be that of another robot."""
    node = joint.find("origin")
    rpy = numbers((node.get("rpy") if node is not None else None) or "0 0 0", 3, "origin rpy")
    off = np.abs(rpy - np.round(rpy / (np.pi / 2)) * (np.pi / 2))
    return bool(((off > EXACT) & (off < SNAP)).any())


def _unit_bodies(text: str) -> Document:
    document = Document(text)
    for element in document.joints.values():
        for tag in ("mimic", "limit"):  # a mimicking joint counts as free, which keeps its β too
            for node in element.findall(tag):
                element.remove(node)
    for name, link in document.links.items():
        for node in link.findall("inertial"):
            link.remove(node)
        joint = document.parent_joint.get(name)
        if joint is not None and document.kind(joint) in MOVING:
            add_inertial(link, 1.0, np.zeros(3), np.eye(3))
    return document


def lumping(model: Model, chain: Chain, links: list[str]) -> Array:
    """T: π of the moving links from π of all links, P → H P Hᵀ at the poses H; 0 on the base."""
    matrix = np.zeros((_P * len(chain.joints), _P * len(links)))
    for row, joint in enumerate(chain.joints):
        for name, pose in model.poses(joint.link).items():
            if name in links:
                column = links.index(name)
                matrix[_P * row : _P * (row + 1), _P * column : _P * (column + 1)] = _moved(pose)
    return matrix


def _moved(pose: Array) -> Array:
    """(10, 10) map of π to another frame, in which the present frame has this pose."""
    unit = np.eye(_P)
    if np.array_equal(pose, unit[:4, :4]):
        return unit
    return np.column_stack([pi_of(pose @ pseudo_of(e) @ pose.T) for e in unit])
