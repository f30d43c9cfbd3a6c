"""What may have changed since an identification: one linear hypothesis per part of the robot.

    e = τ − τ̂ = C_h x + noise

with the columns C_h of a hypothesis: gain of one sensor (τ̂_j), bias of one sensor (1), friction of
one joint or of all (τ_f without its offset), one link (its ten columns of Y), a body on the last
link, all base parameters, or a delay of the torque (−dτ̂/dt).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from runtime.estimators.regression.samples import Samples
from runtime.library import Array, Library
from runtime.library.parameters import link_columns
from runtime.library.torque_units import torque_units
from runtime.monitoring.model import MonitoredModel
from runtime.recording.friction_column import COLUMNS
from runtime.recording.preprocessing import segments

GROUPS = ("sensor gain", "sensor bias", "friction", "links", "payload", "model", "clock")
"""Parts of a robot that are distinguished."""
RARE = 0.01
"""Probability of a change of a link relative to one of the tip, where tools are changed."""


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """Linear change of the torque.

    Attributes:
        group: of `GROUPS`.
        where: joint or link; "" for the whole robot.
        columns: C, (N, n, k).
        scale: factor from the first coefficient to the size that is stated.
        unit: of that size.
        prior: relative probability before the data.
    """

    group: str
    where: str
    columns: Array
    scale: float
    unit: str
    prior: float = 1.0


def hypotheses(
    lib: Library, model: MonitoredModel, pi: Array, t: Array, samples: Samples
) -> Iterator[Hypothesis]:
    """Hypotheses on a log, one at a time.

    pi (10 n,), t (N,) [s].
    """
    count, n = samples.tau.shape
    rigid = samples.rigid(lib, pi)
    friction = samples.friction(model.phi) if model.phi.size else np.zeros_like(rigid)
    changing = [not COLUMNS[name].is_constant for name in model.terms.columns]
    dry = samples.friction(model.phi * changing) if model.phi.size else friction
    tau = rigid + friction
    slope = np.zeros_like(tau)
    for part in segments(t):
        if part.stop - part.start > 2:
            slope[part] = np.gradient(tau[part], t[part], axis=0)
    yield Hypothesis("clock", "", -slope[:, :, None], 1e3, "ms")
    units = torque_units(lib.manifest)
    for j, name in enumerate(lib.joint_names):
        only = np.zeros((count, n, 1))
        for group, values, scale, unit in (
            ("sensor gain", tau[:, j], 100.0, "%"),
            ("sensor bias", np.ones(count), 1.0, units[j]),
            ("friction", dry[:, j], 100.0, "%"),
        ):
            if np.any(values):
                columns = only.copy()
                columns[:, j, 0] = values
                yield Hypothesis(group, name, columns, scale, unit)
    if dry.any():
        yield Hypothesis("friction", "", dry[:, :, None], 100.0, "%")
    rows = lib.regressor(samples.q, samples.dq, samples.ddq)
    for k, name in enumerate(lib.link_names):
        is_tip = k == len(lib.link_names) - 1
        columns = rows[:, :, link_columns(k)]
        prior = 1.0 if is_tip else RARE
        yield Hypothesis("payload" if is_tip else "links", name, columns, 1.0, "kg", prior)
    yield Hypothesis("model", "", samples.base_rows(lib), 1.0, "")
