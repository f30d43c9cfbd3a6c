"""Inspection of one robot model file: numbers per link, findings, base parameters, and repair."""

from collections.abc import Iterator, Mapping
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from symgen.chain.document import first_element
from symgen.chain.mechanism import Mechanism
from symgen.errors import InertiaError, SymgenError, UrdfError
from symgen.inspect import checks
from symgen.inspect.base import SampledBase, base_of
from symgen.inspect.geometry import Extent, Meshes, groups_of
from symgen.inspect.model import ERROR, Body, Finding, Link, Model
from symgen.inspect.reading import read_mjcf, read_urdf
from symgen.inspect.repair import Repair, repair, with_bodies
from symgen.ros.packages import Packages
from symgen.sources import Source, read_source, urdf_text

INERTIAL = frozenset({"triangle", "zero-inertia"})  # kinds of errors that a repair removes
_FINDING = ("severity", "kind", "where", "found", "expected", "sentence")
_CONVERTED = {"xacro": "xacro", "toml": "DH", "sdf": "SDF", "mujoco": "MJCF"}
"""Formats that are checked as the URDF that a build makes of them."""


@dataclass(frozen=True, slots=True, eq=False)
class LinkFigures:
    """Numbers of one link."""

    link: str  # its name
    body: Body  # mass properties
    smallest: float  # smallest eigenvalue of P
    relative: float  # the same relative to tr P
    density: float | None  # mass over the volume of its shapes, kg/m³; None without shapes


@dataclass(frozen=True, slots=True, eq=False)
class Inspection:
    """Contents and faults of a file."""

    model: Model  # links and joints as written
    text: str | None  # the URDF as read, None for MJCF
    rows: tuple[LinkFigures, ...]  # one entry per link with mass or inertia
    findings: tuple[Finding, ...]  # errors first, then warnings
    base: SampledBase | None  # rank and K, None where `notes` give the reason
    notes: tuple[str, ...]  # sentences about parts that could not be checked

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that are physically impossible or cannot be read."""
        return tuple(f for f in self.findings if f.severity == ERROR)


def inspect_file(
    path: Path,
    packages: tuple[Path, ...] = (),
    with_base: bool = True,
    arguments: Mapping[str, str] | None = None,
    chosen: str | None = None,
) -> Inspection:
    """Read and check a robot file that `build` reads: URDF, xacro, MJCF, SDF, TOML of DH rows."""
    text, kind = urdf_text(path), path.suffix.removeprefix(".")
    form = kind if kind in {"xacro", "toml"} else first_element(text)
    if form == "mujoco" and chosen is None and not arguments:
        return _checked(read_mjcf(path), None, Meshes(path, packages), with_base)
    if form not in _CONVERTED and chosen is None and not arguments:
        return inspect_text(text, path, packages, with_base)
    notes: list[str] = []
    source = Source(path, arguments or {}, Packages(packages), chosen)
    text, _ = read_source(source, Mechanism(), notes.append)
    inspection = inspect_text(text, path, packages, with_base)
    named = replace(inspection.model, form=_CONVERTED.get(form, inspection.model.form))
    return replace(inspection, model=named, notes=(*notes, *inspection.notes))


def inspect_text(
    text: str, path: Path, packages: tuple[Path, ...] = (), with_base: bool = True
) -> Inspection:
    """Check a URDF given as text, with the meshes beside its file."""
    return _checked(read_urdf(text), text, Meshes(path, packages), with_base)


def repaired(inspection: Inspection, path: Path) -> tuple[str, Repair, Inspection]:
    """Text of the URDF with the nearest consistent inertials, the changes, and its inspection."""
    if inspection.text is None:
        raise UrdfError("--repair writes URDF; convert the MJCF file first, or correct it by hand")
    changes = repair(inspection.model, inspection.base)
    text = with_bodies(inspection.text, changes.bodies)
    again = inspect_text(text, path, with_base=False)
    before = {(f.kind, f.where) for f in inspection.errors}
    bad = [f for f in again.errors if f.kind in INERTIAL or (f.kind, f.where) not in before]
    if bad:
        raise InertiaError(
            f"not written: the repaired file would still have an error, {bad[0].sentence}; "
            "correct it in the file first"
        )
    return text, changes, again


def facts(inspection: Inspection) -> dict[str, Any]:
    """Return the inspection as JSON-ready values."""
    base = inspection.base
    return {
        "robot": inspection.model.name,
        "format": inspection.model.form,
        "links": [
            {
                "link": row.link,
                "mass": row.body.mass,
                "com": row.body.com.tolist(),
                "principal_moments": row.body.moments.tolist(),
                "triangle_slack": row.body.slack,
                "smallest_eigenvalue": row.smallest,
                "relative_eigenvalue": row.relative,
                "density": row.density,
            }
            for row in inspection.rows
        ],
        "findings": [
            dict(zip(_FINDING, (*astuple(f), f.sentence), strict=True)) for f in inspection.findings
        ],
        "base_parameters": None
        if base is None
        else {"rank": len(base.names), "names": base.names, "condition": base.condition},
        "notes": list(inspection.notes),
    }


def _checked(model: Model, text: str | None, meshes: Meshes, with_base: bool) -> Inspection:
    extents = {name: meshes.extent(link) for name, link in model.links.items()}
    findings = sorted(_findings(model, extents), key=lambda f: f.severity != ERROR)
    notes = list(model.notes)
    base = None
    if text is None:
        notes.append("base parameters are computed for URDF only")
    elif any(f.kind == "unreadable" and f.where.startswith("joint") for f in model.findings):
        notes.append("no base parameters: a joint cannot be read")
    elif with_base:
        try:
            base = base_of(text)
        except SymgenError as error:
            notes.append(f"no base parameters: {error}")
    if base is not None and base.snapped:
        notes.append(
            "angles are rounded in this file: for the base parameters, those within 1e-4 rad of a "
            "multiple of π/2 count as exact"
        )
    if meshes.missing:
        notes.append(
            f"{len(meshes.missing)} mesh file(s) not available or not solid, such as "
            f"'{meshes.missing[0]}': their densities are unknown (see the setting package_dir)"
        )
    bodies = model.bodies.items()
    rows = tuple(_figures(name, body, extents[name]) for name, body in bodies if not body.is_empty)
    return Inspection(model, text, rows, tuple(findings), base, tuple(notes))


def _findings(model: Model, extents: dict[str, Extent | None]) -> Iterator[Finding]:
    """Findings of reading, of each link, of links fixed to each other, of pairs, of joints."""
    yield from model.findings
    unread = {f.where for f in model.findings}
    readable = replace(
        model,
        links={
            name: Link(name) if f"link '{name}'" in unread else link
            for name, link in model.links.items()
        },
    )
    for name in model.links:
        if f"link '{name}'" not in unread:
            yield from checks.consistency_errors(model, name)
    for group in groups_of(readable, extents):
        yield from checks.plausibility_warnings(model, group)
    yield from checks.comparison_warnings(model)
    for joint in model.joints:
        if f"joint '{joint.name}'" not in unread:
            yield from checks.joint_findings(joint)


def _figures(name: str, body: Body, extent: Extent | None) -> LinkFigures:
    smallest = float(np.linalg.eigvalsh(body.pseudo_inertia)[0])
    trace = abs(float(np.trace(body.pseudo_inertia)))
    density = None if extent is None else body.mass / extent.volume
    return LinkFigures(name, body, smallest, smallest / trace if trace else 0.0, density)
