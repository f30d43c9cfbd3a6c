"""Result file of an identification with a free base."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from runtime.estimators.convex import com_sigma
from runtime.estimators.regression.residuals import NORMAL_95
from runtime.estimators.verdicts import PRIOR_DOMINATED
from runtime.files import replacing
from runtime.identification.free_base.identify import FreeBaseIdentification
from runtime.library.parameters import PI_NAMES, centre_of_mass, inertia, links, mass


def free_base_facts(result: FreeBaseIdentification, command: str) -> dict[str, Any]:
    """JSON-ready facts of result.json."""
    total, sigma = result.mass
    vertical = result.vertical
    facts: dict[str, Any] = {
        "free_base": 1,
        "command": command,
        "robot": result.lib.name,
        "model_hash": result.lib.manifest.model_hash,
        "rows": result.rows,
        "n_train": result.n_train,
        "n_test": result.n_test,
        "n_eff": result.n_eff,
        "status": result.status,
        "notes": list(result.notes),
        "total_mass": {
            "value": total,
            "sigma": sigma,
            "interval": [total - NORMAL_95 * sigma, total + NORMAL_95 * sigma],
            "urdf": float(mass(links(result.lib.pi0)).sum()),
        },
        "errors": [
            {"row": name, "rms": r, "before": b, "after": a}
            for name, r, b, a in zip(
                result.row_names,
                result.rms.tolist(),
                result.before.tolist(),
                result.after.tolist(),
                strict=True,
            )
        ],
        "vertical_force": None
        if vertical is None
        else {
            "mean": vertical.weight,
            "before_percent": 100 * vertical.before / abs(vertical.weight),
            "after_percent": 100 * vertical.after / abs(vertical.weight),
        },
        "sensors": result.sensors,
        "links": _links(result),
        "pi": result.pi.tolist(),
        "sigma": np.linalg.norm(result.root, axis=1).tolist(),
        "verdicts": list(result.verdicts),
        "beta": (result.lib.base_matrix @ result.pi).tolist(),
    }
    return facts


def _links(result: FreeBaseIdentification) -> list[dict[str, Any]]:
    lib, size = result.lib, len(PI_NAMES)
    sigma = np.linalg.norm(result.root, axis=1)
    com = com_sigma(result.root, result.pi)
    rows = []
    for k, (name, pi) in enumerate(zip(lib.link_names, links(result.pi), strict=True)):
        verdicts = result.verdicts[k * size : (k + 1) * size]
        spread = com[k]
        rows.append(
            {
                "link": name,
                "mass": float(mass(pi)),
                "mass_sigma": float(sigma[k * size]),
                "com": centre_of_mass(pi).tolist(),
                "com_sigma": None if spread is None else np.asarray(spread).tolist(),
                "inertia": inertia(pi).tolist(),
                "not_identifiable": [
                    entry
                    for entry, verdict in zip(PI_NAMES, verdicts, strict=True)
                    if verdict == PRIOR_DOMINATED
                ],
            }
        )
    return rows


def write_free_base(result: FreeBaseIdentification, folder: Path, command: str) -> dict[str, Any]:
    """Write result.json into a folder."""
    facts = free_base_facts(result, command)
    text = json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    with replacing(folder / "result.json") as file:
        file.write(text.encode())
    return facts
