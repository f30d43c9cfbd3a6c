"""Bodies of links without <inertial> from closed meshes of a stated density.

    V = Σ_t det T_t / 6,   ∫ x = Σ_t det T_t / 24 Σ_i v_i,
    ∫ x xᵀ = Σ_t det T_t / 120 (Σ_i v_i v_iᵀ + s sᵀ),   s = Σ_i v_i

over the triangles t with corners v_1, v_2, v_3; each spans a tetrahedron with the origin, and the
parts outside of the solid cancel. Source: Eberly, Polyhedral mass properties, 2002.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated
from xml.etree.ElementTree import Element

import numpy as np
from msgspec import Meta

from runtime.common.records import record_from_toml
from symgen.chain.document import Document, add_inertial, numbers, origin
from symgen.chain.reading import require_bare
from symgen.errors import BuildError, UrdfError
from symgen.inspect.geometry import LARGEST_MESH, is_sound
from symgen.ros.packages import Packages

DEFAULT = "default"  # key of the density of all links that the file does not name
_MERGED = 1e-6  # distance of equal corners over the size of the mesh: STL has single precision

Array = np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Volume [m³], first moment (3,) [m⁴] and second moment ∫ x xᵀ (3, 3) [m⁵] of a solid."""

    volume: float
    first: Array
    second: Array


def read_densities(path: Path) -> dict[str, float]:
    """Densities of links from a TOML file, kg/m³."""
    kind = dict[str, Annotated[float, Meta(gt=0, description="a density above 0 in kg/m^3")]]
    densities = record_from_toml(kind, path, f"the densities '{path}'", BuildError)
    if not densities:
        raise BuildError(f"'{path}' states no density; write lines such as default = 1200")
    return densities


def with_mesh_bodies(
    urdf: str, folder: Path, densities: Mapping[str, float], packages: Packages
) -> tuple[str, tuple[str, ...]]:
    """Write <inertial> elements for links that have none, from their meshes."""
    document = Document(urdf)
    for link in (name for name in densities if name != DEFAULT):
        require_bare(document, link, "the setting densities")
    done = []
    for name, element in document.links.items():
        density = densities.get(name, densities.get(DEFAULT))
        meshes = [] if density is None else _meshes(element)
        if element.find("inertial") is not None or density is None or not meshes:
            if name in densities:
                raise UrdfError(
                    f"the setting densities names the link '{name}', which has no mesh; state its "
                    "mass with the setting masses"
                )
            continue
        parts = [_placed(mesh, name, folder, packages) for mesh in meshes]
        volume = sum(part.volume for part in parts)
        centre = np.sum([part.first for part in parts], axis=0) / volume
        second = np.sum([part.second for part in parts], axis=0)
        second -= volume * np.outer(centre, centre)
        inertia = density * (np.trace(second) * np.eye(3) - second)
        add_inertial(element, density * volume, centre, inertia)
        done.append(name)
    if not done:
        raise UrdfError(
            "the setting densities gives no link a body: every link has an <inertial>, or no mesh; "
            "leave the option out"
        )
    return document.text(), tuple(done)


def moments_of(vertices: Array, triangles: Array, owner: str) -> Moments:
    """Volume and moments of a closed mesh."""
    size = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    grid = np.round(vertices / max(_MERGED * size, 1e-300))
    corners = np.unique(grid, axis=0, return_inverse=True)[1].reshape(-1)[triangles]
    proper = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    corners, triangles = corners[proper], triangles[proper]
    edges = np.vstack([corners[:, [k, (k + 1) % 3]] for k in range(3)])
    both = np.unique(np.vstack([edges, edges[:, ::-1]]), axis=0, return_inverse=True)[1].reshape(-1)
    balance = np.bincount(both[: len(edges)], minlength=int(both.max(initial=0)) + 1)
    balance = balance - np.bincount(both[len(edges) :], minlength=len(balance))
    v = vertices[triangles]
    det = np.linalg.det(v) if len(v) else np.zeros(0)
    volume = float(det.sum() / 6)
    open_edges = int(np.abs(balance).sum() // 2)
    if open_edges or not abs(volume) > 1e-9 * size**3:
        reason = f"{open_edges} of its edges have no partner" if open_edges else "it has no volume"
        raise BuildError(
            f"{owner} is not a closed surface ({reason}), so its mass cannot be computed from a "
            "density; close the mesh, or state the mass of the link with the setting masses"
        )
    sums = v.sum(axis=1)
    first = np.einsum("t,ti->i", det, sums) / 24
    second = np.einsum("t,tki,tkj->ij", det, v, v) + np.einsum("t,ti,tj->ij", det, sums, sums)
    sign = np.sign(volume)  # triangles that look inward
    return Moments(abs(volume), sign * first, sign * second / 120)


def _meshes(link: Element) -> list[Element]:
    """Shapes of a link with a mesh: visual ones, which are the part, else collision ones."""
    for tag in ("visual", "collision"):
        shapes = [shape for shape in link.findall(tag) if shape.find("geometry/mesh") is not None]
        if shapes:
            return shapes
    return []


def _placed(shape: Element, link: str, folder: Path, packages: Packages) -> Moments:
    """Moments of one shape in the frame of its link."""
    node = shape.find("geometry/mesh")
    if node is None:
        raise BuildError(f"expected a mesh of link '{link}', got another shape; add a mesh")
    file = node.get("filename", "")
    scale = numbers(node.get("scale", "1 1 1"), 3, f"link '{link}': scale of a mesh")
    path = packages.file(Path(file.removeprefix("file://")))
    path = path if path.is_absolute() else folder / path
    rotation, translation = origin(shape, f"shape of link '{link}'")
    vertices, triangles = _loaded(path, scale, link)
    placed = vertices @ rotation.T + translation
    return moments_of(placed, triangles, f"the mesh '{path.name}' of link '{link}'")


def _loaded(path: Path, scale: Array, link: str) -> tuple[Array, Array]:
    """Vertices (V, 3) and triangles (T, 3) of a mesh file."""
    import coal

    try:
        if not path.is_file() or not 0 < path.stat().st_size < LARGEST_MESH:
            raise ValueError("there is no such file, or it is empty or too large")
        if path.suffix.lower() == ".dae" and not is_sound(path):
            raise ValueError("it is damaged")
        model = coal.MeshLoader().load(str(path), scale)
    except (OSError, ValueError, RuntimeError) as error:
        raise BuildError(
            f"cannot read the mesh '{path}' of link '{link}': {' '.join(str(error).split())}; "
            "correct its name, or give --settings package=DIR"
        ) from None
    triangles = [[t[0], t[1], t[2]] for t in map(model.tri_indices, range(model.num_tris))]
    return np.array(model.vertices()), np.array(triangles, dtype=np.intp).reshape(-1, 3)
