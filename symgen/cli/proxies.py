"""Command `proxies`: capsules around the collision geometry of a URDF, and pairs to check."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.common.files import require_unused, write_text
from runtime.common.settings import Choices, argument_field, data_field, method_field, output_field
from runtime.common.tables import Table
from runtime.common.terminal import console, say, show
from symgen.chain import ChainOptions, read_chain
from symgen.cli import common
from symgen.collision.capsules import Coverage, coverage, fit_link
from symgen.collision.geometry import read_geometry
from symgen.collision.model import MARGIN, CollisionModel, toml_from_collision
from symgen.collision.selection import Selection, select_pairs
from symgen.errors import BuildError, CollisionError
from symgen.make.config import RobotConfig, home_of, read_config
from symgen.sources import urdf_text


@dataclass(frozen=True, slots=True, kw_only=True)
class ProxiesSettings(Choices):
    """Settings of `symgen proxies`."""

    options = "out package_dir base tip overwrite"
    urdf: Path = argument_field(help="URDF with <collision> shapes.", dir_okay=False)
    out: Path = output_field(..., help="TOML file to write, for build --config.", dir_okay=False)
    package_dir: list[Path] | None = data_field(
        metavar="DIR", help="Folder in which package:// meshes are searched; repeatable."
    )
    base: common.BaseOption = None
    tip: common.TipOption = None
    lock: common.LockOption = None
    config: common.ConfigOption = None
    most: int = method_field(3, min=1, max=6, help="Largest number of capsules per link.")
    margin: float = method_field(
        MARGIN, help="Distance that a motion keeps between the proxies of a pair, m."
    )
    overwrite: common.OverwriteOption = False


def proxies_command(given: ProxiesSettings) -> None:
    r"""Fit collision capsules to a robot and choose the pairs to check.

    \b
    python -m symgen proxies my.urdf --out my_proxies.toml --package-dir ~/ros/src
    python -m symgen build --urdf my.urdf --name my --config my_proxies.toml

    Every link gets one to MOST capsules that enclose its collision shapes; pairs that never come
    close or always overlap are left out. The TOML file that is written is an input of build.
    """
    require_unused([given.out], given.overwrite, None)
    if not (math.isfinite(given.margin) and given.margin >= 0):
        raise BuildError(
            f"the setting margin needs a distance in m, not below 0, got {given.margin:g}"
        )
    options = ChainOptions(given.base, given.tip, None, common.read_locks(given.lock or []))
    chain = read_chain(urdf_text(given.urdf), options)
    known = read_config(*given.config) if given.config else RobotConfig()
    with console.status("fitting capsules"):
        geometry = read_geometry(chain, given.package_dir or [])
        fitted = tuple(proxy for part in geometry for proxy in fit_link(part, given.most))
        covered = [coverage(part, fitted) for part in geometry]
        home = np.array(home_of(chain, known))
        chosen = select_pairs(chain, fitted, home, geometry, given.margin)
    show(_table(covered))
    for sentence in _sentences(chosen):
        say(sentence)
    worst = max(covered, key=lambda c: c.outside)
    if worst.outside > 0:
        raise CollisionError(
            f"the proxies must enclose link '{worst.link}', which protrudes by "
            f"{1e3 * worst.outside:.3g} mm; nothing was written, please report the URDF"
        )
    header = f"# Capsules around the collision geometry of {chain.name} and pairs to check; m.\n"
    text = header + toml_from_collision(CollisionModel(fitted, chosen.pairs))
    write_text(given.out, text)
    say(f"{given.out}: {len(fitted)} proxies, {len(chosen.pairs)} pairs")


def _table(covered: list[Coverage]) -> Table:
    rows = []
    for c in covered:
        ratio = "-" if math.isnan(c.ratio) else f"{c.ratio:.2f}"
        outside = f"{1e3 * c.outside:.3g} mm"
        rows.append((c.link, str(c.proxies), str(c.corners), outside, ratio))
    return Table(("link", "capsules", "corners", "outside", "volume / hull"), tuple(rows))


def _sentences(chosen: Selection) -> list[str]:
    sentences = [
        f"pair {pair.first} - {pair.second}: margin {1e3 * pair.margin:g} mm"
        for pair in chosen.pairs
    ]
    if chosen.apart:
        sentences.append(f"{len(chosen.apart)} pairs never come close and are left out")
    sentences += [
        f"note: {first} and {second} overlap in every sampled posture and are left out"
        for first, second in chosen.touching
    ]
    return sentences
