"""Prior of a type of robot: `[centre]`, `[friction]`, `[noise]` of a file of inertial priors.

    [centre]
    fr3_link1 = [m, mX, mY, mZ, XX, YY, ZZ, XY, XZ, YZ]  # SI, about the link frame

    [friction]
    coulomb_speed = 0.02             # rad/s, width that the values belong to

    [friction.fr3_joint1]
    viscous = [0.51, 0.05]           # value and standard deviation

    [noise]
    inflation = 14.0                 # N/N_eff
    fr3_joint1 = 0.1                 # N·m, standard deviation of the torque's residual

`fleet` writes them. A link that is not listed keeps the inertia of the URDF.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, NoReturn

import numpy as np
from msgspec import Meta

from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import Prior, bodies_of, prior_of
from runtime.estimators.problem import FrictionPrior, NoiseFloor
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, PI_NAMES, links
from runtime.recording import Friction
from runtime.recording.settings import COLUMNS, WIDTHS, widths_of

LARGEST_PRIOR = 1e9
"""Largest number of the tables [SI]."""
INFLATION = "inflation"
"""Key of N / N_eff in [noise]."""
ALIKE = 1e-9
"""Relative difference below which two widths are the same."""

Real = Annotated[float, Meta(gt=-LARGEST_PRIOR, lt=LARGEST_PRIOR)]
Least = Annotated[float, Meta(ge=0, lt=LARGEST_PRIOR)]
Above = Annotated[float, Meta(gt=0, lt=LARGEST_PRIOR)]
BodyTables = dict[
    str,
    Annotated[
        tuple[Real, ...],
        Meta(
            min_length=N_PARAMETERS,
            max_length=N_PARAMETERS,
            description=f"{N_PARAMETERS} numbers {', '.join(PI_NAMES)}",
        ),
    ],
]
"""[centre]: π0 of links."""
Pair = Annotated[tuple[Real, Above], Meta(description="[value, σ] with σ above 0")]
FrictionTables = dict[str, Annotated[Above, Meta(description="a width above 0")] | dict[str, Pair]]
"""[friction]: widths, and per joint a table of columns."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownFriction:
    """Friction coefficients of a type."""

    columns: tuple[str, ...]  # names of columns
    widths: dict[str, float]  # name → width [rad/s, rad], of the columns that depend on one
    mean: Array  # value per joint and column, (n, k) [N·m per unit of the column]
    sigma: Array  # standard deviations, (n, k); infinite where nothing is known

    @property
    def model(self) -> Friction:
        """Friction model with these columns and widths."""
        return Friction.from_facts({"columns": self.columns, **self.widths})

    def of(self, friction: Friction, columns: tuple[str, ...]) -> FrictionPrior:
        """Prior of the coefficients of a friction model."""
        for name in widths_of(tuple(set(columns) & set(self.columns))) & set(self.widths):
            known, now = self.widths[name], float(getattr(friction, name))
            if abs(known - now) > ALIKE * known:
                way = "use the same width in the recipe"
                if name == "coulomb_speed":
                    way = f"give --settings coulomb_speed={known:g}"
                raise IdentificationError(
                    f"the friction of the prior belongs to {name} = {known:g}, but this log is "
                    f"identified with {now:g}; {way}"
                )
        shape = (len(self.mean), len(columns))
        mean, sigma = np.zeros(shape), np.full(shape, np.inf)
        for k, name in enumerate(columns):
            if name in self.columns:
                at = self.columns.index(name)
                mean[:, k], sigma[:, k] = self.mean[:, at], self.sigma[:, at]
        return FrictionPrior(mean, sigma)


def prior_about(lib: Library, guess: Array, centre: Array | None) -> Prior:
    """Entropic prior about a stated centre, or about a first guess."""
    return prior_of(lib, guess) if centre is None else prior_of(lib, centre, floor=0.0)


def centre_of(stated: BodyTables, where: str, lib: Library) -> Array:
    """Centre of a type.

    Returns (10 n,) [kg, kg·m, kg·m²].
    """
    require_known("centre", stated, lib.link_names, where)
    centre = lib.pi0.copy()
    for name, body in stated.items():
        links(centre)[lib.link_names.index(name)] = body
    if bodies_of(lib).log_det(centre) is None:
        bad = lib.relative_eigenvalues(centre) <= 0
        names = ", ".join(np.array(lib.link_names)[bad])
        _refuse(where, "physically consistent bodies in [centre]", f"another one for {names}")
    return centre


def friction_of(stated: FrictionTables, where: str, lib: Library) -> KnownFriction:
    """Friction of a type."""
    require_known("friction", stated.keys() - WIDTHS, lib.joint_names, where)
    widths = {key: entry for key, entry in stated.items() if isinstance(entry, float)}
    tables = {joint: entry for joint, entry in stated.items() if isinstance(entry, dict)}
    for name in [*(widths.keys() - WIDTHS), *(tables.keys() & WIDTHS)]:
        kind = "a width above 0" if name in WIDTHS else "a table of columns"
        _refuse(where, f"{kind} for friction.{name}", stated[name])
    columns = tuple(dict.fromkeys(column for table in tables.values() for column in table))
    shape = (lib.n_joints, len(columns))
    mean, sigma = np.zeros(shape), np.full(shape, np.inf)
    for joint, table in tables.items():
        require_known(f"friction.{joint}", table, COLUMNS, where)
        for column, pair in table.items():
            at = lib.joint_names.index(joint), columns.index(column)
            mean[at], sigma[at] = pair
    return KnownFriction(columns, widths, mean, sigma)


def noise_of(stated: dict[str, float], where: str, lib: Library) -> NoiseFloor:
    """Noise of a type."""
    require_known("noise", stated, (INFLATION, *lib.joint_names), where)
    inflation = stated.get(INFLATION, 1.0)
    if inflation < 1:
        _refuse(where, f"a number of at least 1 for noise.{INFLATION}", inflation)
    return NoiseFloor(np.array([stated.get(name, 0.0) for name in lib.joint_names]), inflation)


def require_known(place: str, names: Iterable[str], known: Iterable[str], where: str) -> None:
    """Refuse a name of a link, joint or column that a table states and the robot lacks."""
    for name in names:
        if name not in known:
            raise IdentificationError(
                f"{where} has the unknown entry '{place}.{name}'; known are {', '.join(known)}"
            )


def _refuse(where: str, wanted: str, came: object) -> NoReturn:
    raise IdentificationError(f"{where} expects {wanted}, got {came!s:.60}; correct it")
