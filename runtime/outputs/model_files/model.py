"""A robot with identified bodies and friction, as every model file format writes it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import ExportError, ShapeError
from runtime.identification.metrics import CONSISTENCY_TOLERANCE
from runtime.library import Array, Library
from runtime.library.manifest import Manifest
from runtime.outputs.model_files.engines.answer import STATES
from runtime.outputs.model_files.joint_friction import Drives, JointFriction, joint_friction
from runtime.outputs.model_files.urdf_tree import (
    RigidBody,
    Tree,
    body_of,
    read_tree,
    row,
    smallest_eigenvalue,
)
from runtime.recording import Friction


@dataclass(frozen=True, slots=True, eq=False)
class LinkBodies:
    """Rigid bodies of the links."""

    by_link: dict[str, RigidBody]  # bodies of moving links, and of links fixed to these or base
    emptied: tuple[str, ...]  # links whose inertia went to the moving link that carries them
    notes: tuple[str, ...]  # on fixed bodies, one sentence per moving link that carries some


def divide_bodies(lib: Library, pi: Array, tree: Tree) -> LinkBodies:
    """Divide π (10 n,) into bodies of links that add up to π where they are fixed."""
    bodies: dict[str, RigidBody] = {}
    fixed: dict[str, dict[str, RigidBody]] = {name: {} for name in lib.link_names}
    for link in tree.links:
        body = tree.published(link)
        carrier, _ = tree.carrier(link)
        if body is None or link == carrier:
            continue
        if carrier is None:
            bodies[link] = body
        else:
            fixed[carrier][link] = body
    emptied: list[str] = []
    notes: list[str] = []
    for link, whole in zip(lib.link_names, lib.pseudo_inertia(pi), strict=True):
        if not whole[3, 3] > 0:
            raise ExportError(
                f"not written: expected a positive mass of the link '{link}', got "
                f"{whole[3, 3]:g} kg; export a physically consistent result"
            )
        # No engine reads an inertia without a mass.
        massless = [
            name for name, each in fixed[link].items() if not each.mass and each.inertia.any()
        ]
        children = {name: each for name, each in fixed[link].items() if name not in massless}
        rest = _rest(whole, children, tree)
        if massless:
            emptied += massless
            notes.append(
                f"The inertial of {link} includes {', '.join(massless)}, whose inertials without "
                "mass were removed."
            )
        if rest is None:
            bodies[link] = body_of(whole)
            emptied += children
            notes.append(
                f"The inertial of {link} includes {', '.join(children)}, whose inertials were "
                f"removed: {link} without them would not be physically consistent."
            )
        else:
            bodies[link] = body_of(rest)
            bodies |= children
            if children:
                notes.append(
                    f"Published inertials are kept for {', '.join(children)}; the inertial of "
                    f"{link} is the identified one less these."
                )
    return LinkBodies(bodies, tuple(emptied), tuple(notes))


def _rest(whole: Array, children: dict[str, RigidBody], tree: Tree) -> Array | None:
    """P (4, 4) of the moving link alone; None where it or a fixed body is not consistent."""
    rest = whole.copy()
    for name, body in children.items():
        P = body.pseudo_inertia
        if smallest_eigenvalue(P) < -CONSISTENCY_TOLERANCE or not np.isfinite(P).all():
            return None
        _, T = tree.carrier(name)
        rest -= T @ P @ T.T
    # For a moving link without mass, the difference of equal numbers is rounding noise.
    has_mass = rest[3, 3] > 1e-9 * whole[3, 3]
    if children and not (has_mass and smallest_eigenvalue(rest) >= -CONSISTENCY_TOLERANCE):
        return None
    return rest


def couplings(manifest: Manifest) -> dict[str, tuple[dict[str, float], float]]:
    """Dependent joint → its masters with their factors, and its offset [rad, m]."""
    coupling = manifest.coupling
    if coupling is None:
        return {}
    names = [joint.name for joint in manifest.joints]
    return {
        joint.name: (
            {name: float(f) for name, f in zip(names, factors, strict=True) if f != 0},
            float(offset),
        )
        for joint, factors, offset in zip(
            manifest.all_joints, coupling.matrix, coupling.offset, strict=True
        )
        if joint.name not in names
    }


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiedModel:
    """Identified parameters of a robot and the kinematics of its URDF."""

    lib: Library  # the robot
    pi: Array  # (10 n,) identified parameters [kg, kg·m, kg·m²]
    tree: Tree  # links and joints of the URDF
    bodies: LinkBodies  # rigid bodies of the links
    friction: JointFriction  # damping, dry friction and rotor inertia of the joints
    states: int = STATES  # number of random states at which a reloaded file is compared
    drives: Drives | None = None  # gains, delay and σ of the drives; None where unknown

    def comment(self, content: str, *more: str) -> tuple[str, ...]:
        """Comment lines at the head of a file."""
        return (
            f"{content} identified by symgen.",
            f"model hash: {self.lib.manifest.model_hash}",
            f"Gravity in the base frame: {row(self.lib.gravity)} m/s^2.",
            *more,
        )

    def robot_comment(self, *more: str) -> tuple[str, ...]:
        """Comment lines at the head of a file of bodies and joint friction."""
        notes = (*self.bodies.notes, *self.friction.notes)
        late = self.drives.delay_note() if self.drives else ""
        return self.comment("Inertial parameters", *notes, *((late,) if late else ()), *more)


def make_model(
    lib: Library,
    pi: ArrayLike,
    terms: Friction | None = None,
    phi: ArrayLike | None = None,
    *,
    tree: Tree | None = None,
    states: int = STATES,
    drives: Drives | None = None,
) -> IdentifiedModel:
    """Model of a robot; its links may be physically inconsistent, see `require_consistent`."""
    flat = np.asarray(pi, dtype=float)
    if flat.shape != lib.pi0.shape:
        raise ShapeError(
            f"expected pi of the shape {lib.pi0.shape}, got {flat.shape}; give 10 numbers per link"
        )
    bad = np.flatnonzero(~np.isfinite(flat).reshape(lib.n_links, -1).all(axis=1))
    if bad.size:
        links = ", ".join(lib.link_names[k] for k in bad)
        raise ExportError(
            f"not written: expected finite parameters, got others for {links}; "
            "identify the robot again"
        )
    tree = read_tree(lib) if tree is None else tree
    friction = joint_friction(lib, terms, None if phi is None else np.asarray(phi, dtype=float))
    bodies = divide_bodies(lib, flat, tree)
    return IdentifiedModel(lib, flat, tree, bodies, friction, states, drives)


def require_no_coupling(model: IdentifiedModel, kind: str) -> None:
    """Raise ExportError where joints follow others, which a format cannot state here."""
    facts = model.lib.manifest
    if facts.coupling is not None or facts.loops:
        others = "mjcf or usd" if facts.loops else "urdf or mjcf"
        raise ExportError(
            f"not written: {kind} files are written for robots whose joints are all independent, "
            f"and joints of '{model.lib.name}' follow others; export {others}, which state this"
        )


def springs_left_out(lib: Library) -> str:
    """Sentence about springs and torque curves, which no format states; empty without such."""
    if not (lib.manifest.springs or "known_torque" in lib.manifest.kernels):
        return ""
    return (
        f"springs and torque curves of '{lib.name}' are not in these files: their torque is "
        "lib.known_torque(q) + lib.spring_columns(q) @ k, k of the columns spring:NAME"
    )


def require_consistent(model: IdentifiedModel) -> None:
    """Raise ExportError where a link is not physically consistent."""
    eigenvalues = model.lib.relative_eigenvalues(model.pi)
    bad = np.flatnonzero(~(eigenvalues >= -CONSISTENCY_TOLERANCE))
    if bad.size:
        links = ", ".join(model.lib.link_names[k] for k in bad)
        raise ExportError(
            f"not written: expected physically consistent links, got {links} (smallest eigenvalue "
            f"of the pseudo-inertia {eigenvalues[bad].min():.2e} of its trace); "
            "export a physically consistent result, or lib.nearest_realisable(pi)"
        )


def xml_comment(lines: tuple[str, ...]) -> str:
    """XML comment; two hyphens in a row, which end it, are separated."""
    text = "\n     ".join(line.replace("--", "- -") for line in lines)
    return f"<!-- {text} -->\n"


def require_loop_frames(model: IdentifiedModel) -> None:
    """Raise ExportError where the robot was built before its manifest held the frames of loops."""
    manifest = model.lib.manifest
    if manifest.loops and not manifest.loop_joints:
        raise ExportError(
            f"not written: the manifest of '{model.lib.name}' lacks the frames of its loops; "
            "run: python -m symgen build"
        )
