"""Several motions that share a time, each designed with what those before it determine.

    min over motion k of f(G₀ + G_1 + … + G_k),    G_i the information of motion i over β

f is the criterion, G_0 that of earlier logs. A later motion excites what the first ones left open.
Friction and offsets are estimated for every log apart, which counts them more often than a fit of
all logs does.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.motion.trajectory import Trajectory
from runtime.excitation.search.condition_cost import INFORMED_SAMPLES
from runtime.excitation.search.design import Design, design
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import Information
from runtime.excitation.search.measures import covariance
from runtime.excitation.search.nuisance import in_time, projected
from runtime.excitation.search.unseen_motions import unseen_joints
from runtime.library import Array, Library


def design_several(
    lib: Library, settings: DesignSettings, count: int, **search: Any
) -> tuple[Design, ...]:
    """Design motions in a row, all of the same duration."""
    known = settings.information
    if count < 1:
        raise IdentificationError(f"expected one motion or more, got {count}")
    if known is None:
        raise IdentificationError(
            f"criterion {settings.criterion} counts no information, by which several motions "
            "complement each other; choose another one, such as v"
        )
    designs: list[Design] = []
    for k in range(count):
        one = replace(
            settings,
            duration=settings.duration / count,
            seed=settings.seed + k,
            information=known,
        )
        designs.append(design(lib, one, **search))
        known = with_motion(lib, designs[-1].trajectory, known)
    return tuple(designs)


def torque_sigma(lib: Library, home: Array, known: Information) -> float:
    """σ of the torque of motions never seen, all joints together, by what is known [N·m, N].

    home (n,) [rad, m].
    """
    seen = np.sum(unseen_joints(lib, home), axis=0)
    gram = np.zeros_like(seen) if known.earlier is None else known.earlier
    if known.columns is not None:
        seen, gram = (known.columns.T @ one @ known.columns for one in (seen, gram))
    spread = covariance(gram)
    return np.inf if spread is None else float(np.sqrt(np.sum(seen * spread)))


def with_motion(lib: Library, motion: Trajectory, known: Information) -> Information:
    """Information after the log of a motion."""
    t = np.linspace(0.0, motion.duration, INFORMED_SAMPLES)
    q, dq, ddq, _ = motion.at(lib, t)
    rows, filtered = lib.base_regressor(q, dq, ddq)[None], None
    if known.spectrum is not None:
        filtered = known.spectrum.weighted_cosines(len(t), float(t[1]))
        rows = in_time(filtered, rows)
    if known.friction:
        rows = projected(rows, dq[None], known.friction, filtered).rows
    flat = (rows[0] / known.noise[:, None]).reshape(-1, rows.shape[-1])
    gram: Array = flat.T @ flat * (known.rate * motion.duration / len(t))
    return replace(known, earlier=gram if known.earlier is None else known.earlier + gram)
