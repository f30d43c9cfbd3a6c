"""Model files of many draws from a posterior, and a table of their factors.

Every file is reloaded by its engine: the first of a format at 1000 random states, the others at a
few, since they differ in numbers only.

Training runs import one whole draw per environment. The bodies of a draw are those of its model
file: links that are fixed to a moving one keep their published inertials. Delays have a normal
distribution of their own about the identified value, cut at zero: result.json keeps no covariance
between them and the bodies.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from runtime.common.files import replacing, write_json
from runtime.identification.saved_result import SavedResult
from runtime.library import Array, Library
from runtime.library.parameters import centre_of_mass, links, mass
from runtime.monitoring.posterior_draws import Draws
from runtime.outputs.model_files.engines.answer import STATES
from runtime.outputs.model_files.export import write_model
from runtime.outputs.model_files.export_format import EXPORT_FORMATS, require_base
from runtime.outputs.model_files.joint_friction import TERMS, drives_of, joint_friction
from runtime.outputs.model_files.model import make_model, require_consistent
from runtime.outputs.model_files.urdf_tree import read_tree

FEW = 4  # random states at which later files of a format are compared
TABLE, ARRAYS = "samples.json", "samples.npz"


def sample_paths(folder: Path, count: int, kinds: Sequence[str]) -> list[Path]:
    """Files that `write_samples` writes."""
    models = [_path(folder, k, kind) for k in range(count) for kind in kinds]
    return [folder / TABLE, folder / ARRAYS, *models]


def write_samples(
    lib: Library, saved: SavedResult, draws: Draws, kinds: Sequence[str], folder: Path, seed: int
) -> dict[str, Any]:
    """Write the model files of draws, samples.npz with π and φ, and samples.json with factors."""
    for kind in kinds:
        require_base(lib, EXPORT_FORMATS[kind])
    tree = read_tree(lib)
    sentences: dict[str, str] = {}
    for k, (pi, phi) in enumerate(zip(draws.pi, draws.phi, strict=True)):
        states = STATES if k == 0 else FEW
        model = make_model(lib, pi, saved.friction, phi, tree=tree, states=states)
        require_consistent(model)
        for kind in kinds:
            sentence = write_model(model, EXPORT_FORMATS[kind], _path(folder, k, kind))
            sentences.setdefault(kind, sentence)
    facts = {
        "robot": lib.name,
        "model_hash": lib.manifest.model_hash,
        "count": len(draws.pi),
        "seed": seed,
        "effective_sample_size": draws.effective,
        "acceptance": draws.acceptance,
        "links": list(lib.link_names),
        "joints": list(lib.joint_names),
        "checks": sentences,
        "files": {
            kind: [_path(folder, k, kind).name for k in range(len(draws.pi))] for kind in kinds
        },
        "factors": factors(lib, saved, draws),
    }
    with replacing(folder / ARRAYS) as file:
        np.savez_compressed(file, pi=draws.pi, phi=draws.phi)
    write_json(folder / TABLE, facts, allow_nan=True)
    return facts


def factors(lib: Library, saved: SavedResult, draws: Draws) -> dict[str, list[Any]]:
    """Values of draws relative to the result, one row per draw."""
    bodies = draws.pi.reshape(len(draws.pi), -1, links(saved.pi).shape[1])
    table: dict[str, list[Any]] = {
        "mass": (mass(bodies) / mass(links(saved.pi))).tolist(),
        "com_shift": (centre_of_mass(bodies) - centre_of_mass(links(saved.pi))).tolist(),
    }
    usual = joint_friction(lib, saved.friction, saved.phi)
    each = [joint_friction(lib, saved.friction, phi) for phi in draws.phi]
    for term in TERMS:
        base = getattr(usual, term)
        if any(value is not None for value in base):
            table[term] = [
                [
                    value / start if value is not None and start else None
                    for value, start in zip(getattr(one, term), base, strict=True)
                ]
                for one in each
            ]
    return table


def _path(folder: Path, k: int, kind: str) -> Path:
    return folder / f"model_{k + 1:04d}{Path(EXPORT_FORMATS[kind].file).suffix}"


SIMULATORS = ("playground", "mjlab", "isaaclab")  # with a Python file in `randomisers/`
RANDOMISERS = (*SIMULATORS, "json")
RANDOM_ARRAYS, RANGES = "randomisation.npz", "randomisation.json"
SHARE = 0.95  # share of the draws that the ranges hold


def randomiser_paths(folder: Path, kinds: Sequence[str]) -> list[Path]:
    """Files that `write_randomisers` writes."""
    files = [f"randomise_{kind}.py" for kind in kinds if kind in SIMULATORS]
    names = [*files, *([RANDOM_ARRAYS] if files else []), *([RANGES] if "json" in kinds else [])]
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
    names: dict[str, Any] = {"links": lib.link_names, "joints": lib.joint_names}
    for path in randomiser_paths(folder, kinds):
        with replacing(path) as file:
            if path.name == RANDOM_ARRAYS:
                np.savez_compressed(file, **(names | arrays))
            elif path.name == RANGES:
                ends = (0.5 - SHARE / 2, 0.5 + SHARE / 2)
                ranges = {key: np.quantile(x, ends, axis=0).tolist() for key, x in arrays.items()}
                each = {key: values.tolist() for key, values in arrays.items()}
                facts = {"robot": lib.name, **names, "ranges": ranges, "draws": each}
                file.write(f"{json.dumps(facts, ensure_ascii=False)}\n".encode())
            else:
                kind = path.stem.removeprefix("randomise_")
                file.write((head + (texts / f"{kind}.py.txt").read_text("utf-8")).encode())


def simulator_arrays(
    lib: Library, saved: SavedResult, draws: Draws, rng: np.random.Generator
) -> dict[str, Array]:
    """Arrays of N draws in SI units; axes are quaternions w, x, y, z of the principal axes."""
    tree = read_tree(lib)
    pairs = zip(draws.pi, draws.phi, strict=True)
    models = [make_model(lib, pi, saved.friction, phi, tree=tree) for pi, phi in pairs]
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
