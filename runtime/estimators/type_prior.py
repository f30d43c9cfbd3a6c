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

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from runtime.errors import IdentificationError
from runtime.estimators.convex import Prior, bodies_of, prior_of
from runtime.estimators.problem import FrictionPrior, NoiseFloor
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, PI_NAMES, links
from runtime.recording import Friction
from runtime.recording.settings import COLUMNS, WIDTHS, widths_of

LARGEST = 1e9
"""Largest number of the tables [SI]."""
INFLATION = "inflation"
"""Key of N / N_eff in [noise]."""
ALIKE = 1e-9
"""Relative difference below which two widths are the same."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownFriction:
    """Friction coefficients of a type.

    Attributes:
        columns: names of columns.
        widths: name → width [rad/s, rad], of the columns that depend on one.
        mean: value per joint and column, (n, k) [N·m per unit of the column].
        sigma: standard deviations, (n, k); infinite where nothing is known.
    """

    columns: tuple[str, ...]
    widths: dict[str, float]
    mean: Array
    sigma: Array

    @property
    def model(self) -> Friction:
        """Friction model with these columns and widths."""
        return Friction.from_facts({"columns": self.columns, **self.widths})

    def of(self, friction: Friction, columns: tuple[str, ...]) -> FrictionPrior:
        """Prior of the coefficients of a friction model."""
        for name in widths_of(tuple(set(columns) & set(self.columns))) & set(self.widths):
            known, now = self.widths[name], float(getattr(friction, name))
            if abs(known - now) > ALIKE * known:
                option = "; give --coulomb-speed" if name == "coulomb_speed" else ""
                raise IdentificationError(
                    f"the friction of the prior belongs to {name} = {known:g}, but this log is "
                    f"identified with {now:g}{option or '; use the same width in the recipe'}"
                    f"{f' {known:g}' if option else ''}"
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


def read_centre(facts: Mapping[str, Any], path: Path, lib: Library) -> Array | None:
    """Centre of a type.

    Returns (10 n,) [kg, kg·m, kg·m²].
    """
    if "centre" not in facts:
        return None
    table = _table(facts["centre"], "centre", path)
    centre = lib.pi0.copy()
    for name, given in table.items():
        if name not in lib.link_names:
            _refuse(path, f"links of '{lib.name}' ({', '.join(lib.link_names)}) in [centre]", name)
        wanted = f"{N_PARAMETERS} numbers {', '.join(PI_NAMES)} for centre.{name}"
        if not (isinstance(given, list) and len(given) == N_PARAMETERS and all(map(_real, given))):
            _refuse(path, wanted, given)
        links(centre)[lib.link_names.index(name)] = given
    if bodies_of(lib).log_det(centre) is None:
        bad = lib.relative_eigenvalues(centre) <= 0
        names = ", ".join(np.array(lib.link_names)[bad])
        _refuse(path, "physically consistent bodies in [centre]", f"another one for {names}")
    return centre


def read_friction(facts: Mapping[str, Any], path: Path, lib: Library) -> KnownFriction | None:
    """Friction of a type."""
    if "friction" not in facts:
        return None
    given = _table(facts["friction"], "friction", path)
    widths = {key: given[key] for key in WIDTHS if key in given}
    for key, width in widths.items():
        if not (_real(width) and width > 0):
            _refuse(path, f"a width above 0 for friction.{key}", width)
    tables = {name: table for name, table in given.items() if name not in WIDTHS}
    columns: list[str] = []
    values: dict[tuple[str, str], tuple[float, float]] = {}
    for joint, entries in tables.items():
        if joint not in lib.joint_names:
            _refuse(path, f"joints ({', '.join(lib.joint_names)}) in [friction]", joint)
        for column, pair in _table(entries, f"friction.{joint}", path).items():
            if column not in COLUMNS:
                _refuse(path, f"friction columns in [friction.{joint}]", column)
            is_pair = isinstance(pair, list) and len(pair) == 2 and all(map(_real, pair))
            if not (is_pair and pair[1] > 0):
                _refuse(path, f"[value, σ] with σ above 0 for friction.{joint}.{column}", pair)
            values[joint, column] = (float(pair[0]), float(pair[1]))
            columns += [column] if column not in columns else []
    shape = (lib.n_joints, len(columns))
    mean, sigma = np.zeros(shape), np.full(shape, np.inf)
    for (joint, column), pair in values.items():
        at = lib.joint_names.index(joint), columns.index(column)
        mean[at], sigma[at] = pair
    exact = {key: float(width) for key, width in widths.items()}
    return KnownFriction(tuple(columns), exact, mean, sigma)


def read_noise(facts: Mapping[str, Any], path: Path, lib: Library) -> NoiseFloor | None:
    """Noise of a type."""
    if "noise" not in facts:
        return None
    sigma, inflation = np.zeros(lib.n_joints), 1.0
    for name, given in _table(facts["noise"], "noise", path).items():
        if name != INFLATION and name not in lib.joint_names:
            _refuse(path, f"{INFLATION} or joints ({', '.join(lib.joint_names)}) in [noise]", name)
        least = 1.0 if name == INFLATION else 0.0
        if not (_real(given) and given >= least):
            _refuse(path, f"a number of at least {least:g} for noise.{name}", given)
        if name == INFLATION:
            inflation = float(given)
        else:
            sigma[lib.joint_names.index(name)] = given
    return NoiseFloor(sigma, inflation)


def _table(given: Any, name: str, path: Path) -> dict[str, Any]:
    if not isinstance(given, dict):
        _refuse(path, f"a table [{name}]", given)
    return dict(given)


def _real(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and isfinite(value) and abs(value) < LARGEST


def _refuse(path: Path, wanted: str, came: Any) -> NoReturn:
    shown = came if isinstance(came, str) else repr(came)
    raise IdentificationError(f"the prior '{path}' expects {wanted}, got {shown:.60}; correct it")
