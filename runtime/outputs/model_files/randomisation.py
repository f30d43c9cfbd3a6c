"""Draws from the posterior as files that a training run imports: one whole draw per environment.

The bodies of a draw are those of its model file: links that are fixed to a moving one keep their
published inertials. Delays have a normal distribution of their own about the identified value, cut
at zero: result.json keeps no covariance between them and the bodies.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from runtime.common.files import replacing
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.monitoring.posterior_draws import Draws
from runtime.outputs.model_files.drives import drives_of
from runtime.outputs.model_files.joint_friction import TERMS
from runtime.outputs.model_files.model import make_model
from runtime.outputs.model_files.urdf_tree import read_tree

SIMULATORS = ("playground", "mjlab", "isaaclab")
"""Simulators for which a Python file is written; its text lies in `randomisers/`."""
RANDOMISERS = (*SIMULATORS, "json")
ARRAYS, TABLE = "randomisation.npz", "randomisation.json"
SHARE = 0.95
"""Share of the draws that the ranges hold."""


def randomiser_paths(folder: Path, kinds: Sequence[str]) -> list[Path]:
    """Files that `write_randomisers` writes."""
    files = [f"randomise_{kind}.py" for kind in kinds if kind in SIMULATORS]
    names = [*files, *([ARRAYS] if files else []), *([TABLE] if "json" in kinds else [])]
    return [folder / name for name in names]


def write_randomisers(
    lib: Library,
    saved: SavedResult,
    draws: Draws,
    kinds: Sequence[str],
    folder: Path,
    rng: np.random.Generator,
) -> None:
    """Write randomise_SIMULATOR.py and their arrays, and randomisation.json with the ranges."""
    arrays = simulator_arrays(lib, saved, draws, rng)
    texts = Path(__file__).with_name("randomisers")
    head = (texts / "head.py.txt").read_text(encoding="utf-8")
    head = head.replace("{robot}", lib.name).replace("{count}", str(len(draws.pi)))
    for path in randomiser_paths(folder, kinds):
        with replacing(path) as file:
            if path.name == ARRAYS:
                names = {"links": np.array(lib.link_names), "joints": np.array(lib.joint_names)}
                content: dict[str, Any] = {**arrays, **names}
                np.savez_compressed(file, **content)
            elif path.name == TABLE:
                file.write(_table(lib, arrays).encode())
            else:
                kind = path.stem.removeprefix("randomise_")
                file.write((head + (texts / f"{kind}.py.txt").read_text("utf-8")).encode())


def _table(lib: Library, arrays: dict[str, Array]) -> str:
    ends = (0.5 - SHARE / 2, 0.5 + SHARE / 2)
    facts: dict[str, Any] = {
        "robot": lib.name,
        "links": list(lib.link_names),
        "joints": list(lib.joint_names),
        "ranges": {
            key: np.quantile(values, ends, axis=0).tolist() for key, values in arrays.items()
        },
        "draws": {key: values.tolist() for key, values in arrays.items()},
    }
    return json.dumps(facts, ensure_ascii=False) + "\n"


def simulator_arrays(
    lib: Library, saved: SavedResult, draws: Draws, rng: np.random.Generator
) -> dict[str, Array]:
    """Arrays of N draws in SI units; axes are quaternions w, x, y, z of the principal axes.

    mass (N, L), com (N, L, 3), inertia about it (N, L, 3, 3), its moments (N, L, 3) and axes
    (N, L, 4); damping, friction, armature and delay (N, n).
    """
    tree = read_tree(lib)
    models = [
        make_model(lib, pi, saved.friction, phi, tree=tree)
        for pi, phi in zip(draws.pi, draws.phi, strict=True)
    ]
    bodies = [[model.bodies.by_link[name] for name in lib.link_names] for model in models]
    inertia = np.array([[body.inertia for body in row] for row in bodies])
    moments, axes = np.linalg.eigh(inertia)
    axes[np.linalg.det(axes) < 0] *= -1.0
    quaternions = Rotation.from_matrix(axes.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    friction = {term: np.array([m.friction.filled(term) for m in models]) for term in TERMS}
    drives, delay = drives_of(saved.record), np.zeros((len(models), lib.n_joints))
    if drives is not None:
        values, sigma = (
            np.array([x or 0.0 for x in each]) for each in (drives.delay, drives.delay_sigma)
        )
        delay = np.maximum(values + sigma * rng.standard_normal((len(models), 1)), 0.0)
    return {
        "mass": np.array([[body.mass for body in row] for row in bodies]),
        "com": np.array([[body.com for body in row] for row in bodies]),
        "inertia": inertia,
        "moments": moments,
        "axes": quaternions.reshape(*moments.shape[:2], 4),
        **friction,
        "delay": np.broadcast_to(delay, (len(models), lib.n_joints)),
    }
