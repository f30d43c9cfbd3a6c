"""Model files of many draws from a posterior, and a table of their factors.

Every file is reloaded by its engine: the first of a format at 1000 random states, the others at a
few, since they differ in numbers only.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import replacing, write_json
from runtime.errors import ExportError
from runtime.identification.saved_result import SavedResult
from runtime.library import Library
from runtime.library.parameters import centre_of_mass, links, mass
from runtime.monitoring.posterior_draws import Draws
from runtime.outputs.model_files.engines.answer import STATES, Unreadable
from runtime.outputs.model_files.export_format import EXPORT_FORMATS, require_base, save
from runtime.outputs.model_files.joint_friction import TERMS, joint_friction
from runtime.outputs.model_files.model import make_model, require_consistent
from runtime.outputs.model_files.urdf_tree import read_tree

FEW = 4
"""Random states at which later files of a format are compared."""
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
            chosen = EXPORT_FORMATS[kind]
            try:
                text = chosen.write(model)
                sentence = chosen.check(model, text)
            except Unreadable as error:
                raise ExportError(
                    f"cannot reload the {kind} of draw {k + 1} ({error}); report this as a fault "
                    "of symgen"
                ) from None
            sentences.setdefault(kind, sentence)
            save(_path(folder, k, kind), text)
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
                    _ratio(value, start)
                    for value, start in zip(getattr(one, term), base, strict=True)
                ]
                for one in each
            ]
    return table


def _ratio(value: float | None, start: float | None) -> float | None:
    return value / start if value is not None and start else None


def _path(folder: Path, k: int, kind: str) -> Path:
    return folder / f"model_{k + 1:04d}{Path(EXPORT_FORMATS[kind].file).suffix}"
