"""Standard deviations that identification will reach with given samples.

    least squares:  C_β = (A_bᵀ A_b)⁻¹ u           A = what friction leaves of W^½ [Y_b K]
    MAP:            C_π = (AᵀA / u + κ B)⁻¹        B: curvature of the entropic prior
    payload:        (A_kᵀ A_k)⁻¹ u                 A_k: ten columns of the last link, offsets free

W = diag σ⁻² and u = N / N_eff, what correlated residuals take of the information; u is smaller in
proportion where the same motion goes on. Earlier logs are further rows over β.
"""

from dataclasses import dataclass

import numpy as np

from runtime.estimators.convex import CAD, Prior, Reduced, com_sigma, prior_of, reduce, spread_of
from runtime.estimators.regression import Statistics
from runtime.excitation.search.criteria import sizes
from runtime.excitation.search.information import information
from runtime.excitation.search.measures import covariance
from runtime.excitation.search.prediction import payload_sigma
from runtime.identification.expected_accuracy.gain_of_recording import PAYLOAD_MASS
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, PI_NAMES, inertia, links, mass
from runtime.recording.friction import OFFSET


@dataclass(frozen=True, slots=True)
class Knowledge:
    """What is believed before the motion.

    Attributes:
        prior: around which bodies.
        pi: where its curvature is taken, (10 n,); bodies that exist strictly.
        kappa: trust in it.
        earlier: G₀ over β of earlier logs, (n_b, n_b); None is nothing.
        payload_only: the arm is known, but not what the last link carries.
    """

    prior: Prior
    pi: Array
    kappa: float = CAD
    earlier: Array | None = None
    payload_only: bool = False

    @classmethod
    def of(cls, lib: Library) -> "Knowledge":
        """The URDF alone."""
        prior = prior_of(lib)
        return cls(prior, prior.centre)


@dataclass(frozen=True, slots=True)
class Expected:
    """What will be known; all are standard deviations.

    Attributes:
        base: of β by least squares, (n_b,) SI; None where the motion cannot tell all of them.
        base_map: of β by MAP, (n_b,).
        relative: base_map over the size of β.
        pi: of π by MAP, (10 n,).
        share: posterior over prior variance of π, (10 n,), in (0, 1].
        com: of centres of mass by MAP, (n, 3) m.
        root: of the covariance of π.
        payload: of ten parameters of a payload on a known arm, (10,); None where it stays untold.
        payload_com: of its centre of mass, (3,) m.
    """

    base: Array | None
    base_map: Array
    relative: Array
    pi: Array
    share: Array
    com: Array
    root: Array
    payload: Array | None
    payload_com: Array | None

    def torque(self, lib: Library, unseen: Array) -> Array:
        """RMS over unseen motions of the MAP model's torque error per joint, (n,) N·m or N.

        `unseen` is `runtime.excitation.search.unseen_motions.unseen_joints`.
        """
        over_base = lib.base_matrix @ self.root
        return np.sqrt([np.sum(over_base * (own @ over_base)) for own in unseen])

    def by_name(self, lib: Library, payload_only: bool = False) -> dict[str, float]:
        """One number per thing that one wants to know: payload, links, base parameters."""
        told = {}
        if self.payload is not None and self.payload_com is not None:
            told[PAYLOAD_MASS] = float(mass(self.payload))
            told["payload CoM"] = float(np.linalg.norm(self.payload_com))
            if payload_only:
                told["payload inertia"] = float(np.linalg.norm(inertia(self.payload)))
        if payload_only:
            return told
        rows = zip(lib.link_names, links(self.pi), self.com, strict=True)
        for link, own, com in rows:
            told[f"mass of {link}"] = float(mass(own))
            told[f"CoM of {link}"] = float(np.linalg.norm(com))
            told[f"inertia of {link}"] = float(np.linalg.norm(inertia(own)))
        return told | dict(zip(base_names(lib), self.base_map.tolist(), strict=True))


def base_names(lib: Library) -> tuple[str, ...]:
    """Every base parameter by the standard one it is regrouped around."""
    places = [divmod(column, N_PARAMETERS) for column in lib.base_columns]
    return tuple(f"base {PI_NAMES[k]} of {lib.link_names[link]}" for link, k in places)


def expected(
    lib: Library,
    statistics: Statistics,
    known: Knowledge,
    unit: float = 1.0,
    columns: tuple[str, ...] | None = None,
) -> Expected:
    """Standard deviations by samples whose rows stand over their noise.

    Args:
        lib: of the robot.
        statistics: of the samples; W is 1/σ², their torque counts for nothing.
        known: before them.
        unit: u, the variance of a weighted row with its inflation.
        columns: names of the friction columns per joint; with None nobody asks for a payload.
    """
    whole = _rows(lib, statistics, known.earlier, unit)
    base = covariance_of_rows(whole[:, list(lib.base_columns)])
    spread = spread_of(known.prior.bodies, known.pi, whole, known.kappa)
    base_map = np.linalg.norm(lib.base_matrix @ spread.root, axis=1)
    com = com_sigma(spread.root, known.pi)
    payload = None if columns is None else _payload(lib, statistics, known, unit, columns)
    return Expected(
        base=None if base is None else np.sqrt(np.diag(base)),
        base_map=base_map,
        relative=base_map / sizes(lib, information(lib)),
        pi=np.linalg.norm(spread.root, axis=1),
        share=spread.share,
        com=np.array([own for own in com if own is not None]),
        root=spread.root,
        payload=None if payload is None else np.sqrt(np.diag(payload)),
        payload_com=None if payload is None else payload_sigma(payload)[1],
    )


def covariance_of_rows(rows: Array) -> Array | None:
    """(AᵀA)⁻¹, or None where A has no full rank to rounding."""
    return covariance(rows.T @ rows)


def _payload(
    lib: Library, statistics: Statistics, known: Knowledge, unit: float, columns: tuple[str, ...]
) -> Array | None:
    """Covariance of the last link's ten: friction is the known arm's, sensors drift."""
    frozen = np.array([name != OFFSET.name for name in columns] * lib.n_joints, dtype=bool)
    earlier = known.earlier if known.payload_only else None
    return covariance_of_rows(
        _rows(lib, statistics.without(frozen), earlier, unit)[:, -N_PARAMETERS:]
    )


def _rows(lib: Library, statistics: Statistics, earlier: Array | None, unit: float) -> Array:
    """A / √u over π, with the rows of earlier logs, (m, 10 n)."""
    data: Reduced = reduce(statistics, lib.n_joints)[0]
    rows = data.factor / np.sqrt(unit)
    if earlier is None:
        return rows
    values, vectors = np.linalg.eigh(earlier)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    return np.vstack([rows, root @ lib.base_matrix])


def facts(found: Expected, lib: Library, payload_only: bool = False) -> dict[str, object]:
    """For JSON files, SI."""
    payload = None
    if found.payload is not None and found.payload_com is not None:
        payload = {
            "mass": float(mass(found.payload)),
            "com": found.payload_com.tolist(),
            "pi": found.payload.tolist(),
        }
    if payload_only:
        return {"payload": payload}
    rows = zip(
        lib.link_names,
        links(found.pi),
        found.com,
        links(found.share),
        strict=True,
    )
    return {
        "base_parameters": {
            "names": list(base_names(lib)),
            "least_squares": None if found.base is None else found.base.tolist(),
            "map": found.base_map.tolist(),
            "map_relative": found.relative.tolist(),
        },
        "links": {
            name: {
                "mass": float(mass(own)),
                "com": com.tolist(),
                "inertia": inertia(own).tolist(),
                "share_of_prior_variance": share.tolist(),
            }
            for name, own, com, share in rows
        },
        "payload": payload,
    }
