"""Contradictions between data, prior and result, in sentences that say which of them is wrong.

Before any statement of trust: do the torques fit the inertial prior (`convex.prior_agreement`), do
the torques of the joints fit each other, does their clock fit that of the motion, does the friction
fit its columns (`regression.deviation_tests`), and does the result fit the torques?
"""

from dataclasses import dataclass, field

import numpy as np

from runtime.estimators.column_faults import column_faults
from runtime.estimators.convex.eliminate_friction import Reduced
from runtime.estimators.convex.entropic_prior import Prior
from runtime.estimators.convex.prior_agreement import LEAST_DENSITY, PriorTest, prior_test
from runtime.estimators.regression.deviation_tests import (
    DelayTest,
    FrictionTest,
    GainTest,
    delay_column,
    delay_test,
    friction_columns,
    friction_test,
    gain_test_of,
)
from runtime.estimators.regression.omitted_columns import FreeFit, with_columns
from runtime.library import Array, Library

SCALE = 3.0
"""Factor between measured torque and that of the URDF beyond which the unit of the torque is the
likeliest fault: a load of twice the own weight of an arm stays below it."""
VISIBLE = 0.10
"""Deviation of a torque gain that a log should show; joints whose limit is higher are named."""
UNFITTED = 2.0
"""Misfit of a result over the threshold of the test of the prior above which the method, and not
the prior, is the cause."""


@dataclass(frozen=True, slots=True, eq=False)
class ModelTests:
    """Results of all tests."""

    # sentences on priors, joints and results that the data contradict
    contradictions: tuple[str, ...] = ()
    # sentences on assumptions of the intervals that the residuals contradict
    model_errors: tuple[str, ...] = ()
    # sentence on joints whose gain may be wrong without a trace; empty where there is none
    limits: tuple[str, ...] = ()
    # deviation of every torque gain that such a log shows in 95 of 100 cases, (n,); empty where it
    # was not tested
    gain_limits: Array = field(default_factory=lambda: np.zeros(0))


def model_tests(
    lib: Library,
    fit: FreeFit | None,
    data: Reduced,
    prior: Prior,
    kappa: float,
    density: float,
    pi: Array,
    *,
    is_of_type: bool = False,
) -> ModelTests:
    """Test data, prior and result against each other."""
    gains = None if fit is None else gain_test_of(fit)
    delay = None if fit is None else delay_test(fit)
    friction = None if fit is None else friction_test(fit)
    sentences: list[str] = []
    errors: list[str] = []
    if delay is not None and delay.is_contradicted:
        (errors if delay.is_usable else sentences).append(_of_delay(delay))
    if gains is not None and gains.is_contradicted:
        sentences.append(_of_gains(lib, gains))
    elif gains is not None and gains.is_significant:
        beside = gains if gains.is_beyond_margin else _beside(gains, fit, delay, friction)
        if beside is not None and beside.is_significant:
            errors.append(_of_small_gain(lib, beside))
    if friction is not None and friction.is_contradicted:
        errors.append(_of_friction(lib, friction))
    test = prior_test(lib, data, prior, kappa, density)
    if test.is_contradicted or (gains is not None and not gains.is_plausible):
        sentences = [*_of_columns(lib, fit), *sentences]
    if test.is_contradicted:
        sentences.append(_of_prior(test, bool(sentences), is_of_type))
    rest = data.factor @ pi - data.target
    misfit = float(rest @ rest) / max(density, LEAST_DENSITY)
    if not test.is_contradicted and misfit > UNFITTED * test.threshold:
        sentences.append(
            f"the result leaves {misfit / test.threshold:.2g} times as much of the training torque "
            "unexplained as its noise and the prior allow, so the method stopped short of the "
            "data; use map"
        )
    limits = np.zeros(0) if gains is None else gains.limits
    return ModelTests(tuple(sentences), tuple(errors), _of_limits(lib, limits), limits)


def _of_columns(lib: Library, fit: FreeFit | None) -> list[str]:
    """Sentences on signs and orders of columns, compared as `inspect` does."""
    if fit is None or fit.samples.acceleration is None or fit.samples.equations != lib.n_joints:
        return []
    named = column_faults(lib, fit.samples).named
    return [
        f"{fault.sentence(lib.joint_names)}: the log is wrong rather than the URDF; inspect "
        "proposes a recipe that corrects it"
        for fault in named
    ]


def _beside(
    gains: GainTest, fit: FreeFit | None, delay: DelayTest | None, friction: FrictionTest | None
) -> GainTest | None:
    """Test of the gains beside a delay and friction that are contradicted: they look like gains."""
    if fit is None:
        return None
    column = delay_column(fit) if delay is not None and delay.is_contradicted else None
    beside = fit if column is None else with_columns(fit, column)
    if friction is not None and friction.is_contradicted:
        beside = with_columns(beside, friction_columns(beside)[0])
    return gains if beside is fit else gain_test_of(beside)


def _of_limits(lib: Library, limits: Array) -> tuple[str, ...]:
    """Sentence on gains that may be wrong by more than `VISIBLE` without a trace."""
    hidden = [
        f"{name} ({f'up to {100 * limit:.2g} %' if limit < 1 else 'of any size'})"
        for name, limit in zip(lib.joint_names, limits, strict=False)
        if limit > VISIBLE
    ]
    if not hidden:
        return ()
    return (
        "this log may not show a wrong torque gain of "
        f"{', '.join(hidden)}, because friction and inertia take it up; "
        "python -m runtime gains determines it",
    )


def _of_delay(test: DelayTest) -> str:
    side = "late" if test.delay > 0 else "early"
    effect = (
        "the parameters take up a part of it, and their intervals are too narrow"
        if test.is_usable
        else "the clock of the torque is wrong rather than the URDF"
    )
    return (
        f"the torque is stamped {1e3 * abs(test.delay):.2g} ± {1e3 * test.sigma:.1g} ms too {side} "
        f"for the motion: {effect}; correct it with --delay auto"
    )


def _of_small_gain(lib: Library, test: GainTest) -> str:
    return (
        f"the torques of the joints contradict each other, mostly by a torque gain of "
        f"{test.gain:.3f} ± {test.sigma:.1g} at {lib.joint_names[test.joint]}, relative to the "
        "other joints: the parameters take up a part of it, and their intervals are too narrow; "
        "calibrate the gains with: python -m runtime gains"
    )


def _of_friction(lib: Library, test: FrictionTest) -> str:
    return (
        f"the residuals of {', '.join(test.names(lib))} contain friction that the columns do not "
        f"describe, a Stribeck peak or friction that grows with the load ({test.excess:.2g} times "
        "the threshold): the parameters take up a part of it, and their intervals are too narrow; "
        "compare with --friction auto"
    )


def _of_gains(lib: Library, test: GainTest) -> str:
    name = lib.joint_names[test.joint]
    if not test.is_plausible:
        return (
            f"the torques of the joints contradict each other, most at {name}, and no torque gain "
            "explains it: the torque is wrong rather than the URDF; check order and sign of the "
            f"signals and the friction of {name} with: python -m runtime inspect LOG"
        )
    return (
        f"the torques of the joints contradict each other, and a torque gain of {test.gain:.2f} "
        f"± {test.sigma:.2g} at {name}, relative to the other joints, explains most of it: the "
        f"torque is wrong rather than the URDF; check the torque constant of {name}, or calibrate "
        "with: python -m runtime gains"
    )


def _of_prior(test: PriorTest, is_torque_wrong: bool, is_of_type: bool) -> str:
    source = "the prior of the fleet" if is_of_type else "the URDF"
    size = f"{test.excess:.2g} times the threshold"
    if not 1 / SCALE < test.scale < SCALE:
        return (
            f"the measured torque is {test.scale:.3g} times that of {source}: the unit or sign of "
            f"the torque is wrong rather than {source}; state them in a recipe (torque in N·m)"
        )
    if is_torque_wrong:
        return f"the data contradict {source} as well ({size}); correct the torque first"
    if not test.links:
        return (
            f"the data contradict the inertias of {source} ({size}), and no single link explains "
            f"it: {source} is of another robot, or order, unit or sign of the signals are wrong; "
            "check them with: python -m runtime inspect LOG"
        )
    bodies = " or ".join(
        f"{name} ({before:.3g} kg in {source}, about {after:.3g} kg from the data)"
        for name, (before, after) in zip(test.links, test.masses, strict=True)
    )
    if is_of_type:
        return (
            f"the data contradict the inertia of {bodies}, or of what it carries ({size}), while "
            "the joints agree with each other: this unit differs from its fleet, or carries a load "
            "that the others did not; leave out --prior, or add its statistics to the fleet"
        )
    return (
        f"the data contradict the inertia of {bodies}, or of what it carries ({size}), while the "
        "joints agree with each other: the URDF is wrong rather than the log, or the arm carries a "
        'load that it does not contain; correct the URDF, or use --prior with trust = "none"'
    )
