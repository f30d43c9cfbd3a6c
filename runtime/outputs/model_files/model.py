"""What is written: a robot with identified bodies and friction, the same for every format."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import ExportError, ShapeError
from runtime.identification.metrics import CONSISTENCY_TOLERANCE
from runtime.library import Array, Library
from runtime.outputs.model_files.bodies import row
from runtime.outputs.model_files.fixed_links import Split, split_bodies
from runtime.outputs.model_files.joint_friction import Drive, read_drive
from runtime.outputs.model_files.urdf_tree import Tree, read_tree
from runtime.recording import Friction


@dataclass(frozen=True, slots=True)
class Model:
    """π (10 n,) of a robot, its bodies link by link, its friction, and the URDF's kinematics."""

    lib: Library
    pi: Array
    tree: Tree
    split: Split
    drive: Drive

    def comment(self, what: str, *more: str) -> tuple[str, ...]:
        """Lines for the head of a file."""
        return (
            f"{what} identified by symgen.",
            f"model hash: {self.lib.manifest.model_hash}",
            f"Gravity in the base frame was {row(self.lib.gravity)} m/s^2.",
            *more,
        )

    def robot_comment(self, *more: str) -> tuple[str, ...]:
        """Lines for a file that holds bodies and drives."""
        notes = (*self.split.notes, *self.drive.notes)
        return self.comment("Inertial parameters", *notes, *more)


def make_model(
    lib: Library, pi: ArrayLike, terms: Friction | None = None, phi: ArrayLike | None = None
) -> Model:
    """A model whose links may be impossible, see `require_consistent`.

    Raises:
        ShapeError: π does not have 10 entries per link.
        ExportError: a mass is not positive, a number not finite, or the URDF is damaged.
    """
    flat = np.asarray(pi, dtype=float)
    if flat.shape != lib.pi0.shape:
        raise ShapeError(f"pi needs the shape {lib.pi0.shape}, got {flat.shape}")
    bad = np.flatnonzero(~np.isfinite(flat).reshape(lib.n_joints, -1).all(axis=1))
    if bad.size:
        links = ", ".join(lib.link_names[k] for k in bad)
        raise ExportError(f"not written: the parameters of {links} are not finite numbers")
    tree = read_tree(lib)
    drive = read_drive(lib, terms, None if phi is None else np.asarray(phi, dtype=float))
    return Model(lib, flat, tree, split_bodies(lib, flat, tree), drive)


def require_consistent(model: Model) -> None:
    """Raise ExportError where a link cannot exist."""
    eigenvalues = model.lib.relative_eigenvalues(model.pi)
    bad = np.flatnonzero(~(eigenvalues >= -CONSISTENCY_TOLERANCE))
    if bad.size:
        links = ", ".join(model.lib.link_names[k] for k in bad)
        raise ExportError(
            f"not written: {links} cannot exist (smallest eigenvalue of the pseudo-inertia "
            f"{eigenvalues[bad].min():.2e} of its trace), and a simulator would refuse or diverge; "
            "export a physically consistent result, or lib.nearest_realisable(pi)"
        )


def xml_comment(lines: tuple[str, ...]) -> str:
    """<!-- … -->, whose text must not hold two hyphens in a row."""
    text = "\n     ".join(line.replace("--", "- -") for line in lines)
    return f"<!-- {text} -->\n"
