"""fleet.toml: the hierarchical prior of a type, read by `identify --prior`."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from runtime.errors import RuntimeFault
from runtime.estimators.prior_file import read_prior
from runtime.estimators.problem import NoiseFloor
from runtime.files import replacing
from runtime.library import Library
from runtime.library.parameters import PI_NAMES, links
from runtime.monitoring.fleet.friction import FleetFriction
from runtime.monitoring.fleet.hierarchy import FleetFit
from runtime.recording.friction_column import widths_of
from runtime.recording.settings import WIDTHS


def prior_text(
    lib: Library,
    names: Sequence[str],
    fit: FleetFit,
    friction: FleetFriction,
    noise: NoiseFloor | None = None,
) -> str:
    """TOML text of a fleet's prior."""
    out = [name for name, flag in zip(names, fit.stands_out, strict=True) if flag]
    low, high = fit.interval
    lines = [
        f"# Prior of the type '{lib.name}' from {len(names)} units; use it with identify --prior.",
        f"trust = {fit.trust!r}",
        "",
        "[fleet]",
        f"robot = {_text(lib.name)}",
        f"model_hash = {_text(lib.manifest.model_hash)}",
        f"units = {len(names) - len(out)}",
        f"kappa = {fit.kappa!r}",
        f"kappa_interval = [{low!r}, {high!r}]",
        f"spread_percent = {100 / np.sqrt(fit.kappa):.6g}",
        f"stand_out = [{', '.join(map(_text, out))}]",
        "",
        "[centre]",
        f"# {', '.join(PI_NAMES)}: kg, kg*m, kg*m^2, inertia about the origin of the link frame",
    ]
    for name, body in zip(lib.link_names, links(fit.centre), strict=True):
        lines.append(f"{_text(name)} = [{', '.join(map(repr, body.tolist()))}]")
    known = np.isfinite(friction.sigma) & (friction.sigma > 0)
    if known.any():
        needed = widths_of(friction.columns)
        lines += ["", "[friction]"]
        pairs = zip(WIDTHS, friction.widths, strict=True)
        lines += [f"{key} = {width!r}" for key, width in pairs if key in needed]
    for j, joint in enumerate(lib.joint_names):
        if known[j].any():
            lines += ["", f"[friction.{_text(joint)}]"]
        for k in np.flatnonzero(known[j]):
            pair = f"[{float(friction.mean[j, k])!r}, {float(friction.sigma[j, k])!r}]"
            lines.append(f"{_text(friction.columns[k])} = {pair}")
    if noise is not None:
        lines += [
            "",
            "[noise]",
            "# inflation N/N_eff; per joint the standard deviation of the torque",
        ]
        lines.append(f"inflation = {noise.inflation!r}")
        pairs_of_noise = zip(lib.joint_names, noise.sigma.tolist(), strict=True)
        lines += [f"{_text(joint)} = {sigma!r}" for joint, sigma in pairs_of_noise]
    return "\n".join(lines) + "\n"


def write_prior(path: Path, text: str, lib: Library) -> None:
    """Write a prior as a whole or not at all, and read it again."""
    with replacing(path) as file:
        file.write(text.encode())
    known = read_prior(path, lib)
    if known.centre is None or not np.isfinite(known.centre).all():
        raise RuntimeFault(f"'{path}' cannot be read again; report this with the statistics")


def _text(value: str) -> str:
    """A TOML string; its escapes are those of JSON without DEL."""
    return json.dumps(value, ensure_ascii=True)
