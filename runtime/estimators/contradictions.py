"""Contradictions between data, prior and result, in sentences that say which of them is wrong.

Before any statement of trust: do the torques fit the inertial prior (`convex.prior_test`), do the
torques of the joints fit each other (`regression.gain_test`), and does the result fit the torques?
"""

from runtime.estimators.convex import Prior, Reduced
from runtime.estimators.convex.prior_test import LEAST_DENSITY, PriorTest, prior_test
from runtime.estimators.regression.friction_test import FrictionTest, friction_test
from runtime.estimators.regression.gain_test import GainTest, gain_test_of
from runtime.estimators.regression.score_test import FreeFit
from runtime.library import Array, Library

SCALE = 3.0
"""Factor between measured torque and that of the URDF beyond which the unit of the torque is the
likeliest fault: a load of twice the own weight of an arm stays below it."""
UNFITTED = 2.0
"""Misfit of a result over the threshold of the test of the prior above which the method, and not
the prior, is the cause."""


def contradictions_of(
    lib: Library,
    fit: FreeFit | None,
    data: Reduced,
    prior: Prior,
    kappa: float,
    density: float,
    pi: Array,
) -> tuple[str, ...]:
    """Contradictions between data, prior and result.

    Args:
        lib: library of the robot.
        fit: least squares of the training samples without a prior; None for rows of power.
        data: least squares over π, friction eliminated.
        prior: inertial prior.
        kappa: trust κ in the prior.
        density: S, variance with which the noise enters the unknowns, in units of `data`.
        pi: parameters of the result, (10 n,).

    Returns:
        One sentence per contradiction; empty where everything fits.
    """
    gains = None if fit is None else gain_test_of(fit)
    test = prior_test(lib, data, prior, kappa, density)
    sentences = []
    if gains is not None and gains.is_contradicted:
        sentences.append(_of_gains(lib, gains))
    if test.is_contradicted:
        sentences.append(_of_prior(test, bool(sentences)))
    rest = data.factor @ pi - data.target
    misfit = float(rest @ rest) / max(density, LEAST_DENSITY)
    if not test.is_contradicted and misfit > UNFITTED * test.threshold:
        sentences.append(
            f"the result leaves {misfit / test.threshold:.2g} times as much of the training torque "
            "unexplained as its noise and the prior allow, so the method stopped short of the "
            "data; use map"
        )
    return tuple(sentences)


def model_errors_of(lib: Library, fit: FreeFit | None) -> tuple[str, ...]:
    """Assumptions of the intervals that the residuals contradict.

    Args:
        lib: library of the robot.
        fit: least squares of the training samples without a prior; None for rows of power.

    Returns:
        One sentence per assumption; empty where the residuals are noise.
    """
    test = None if fit is None else friction_test(fit)
    return () if test is None or not test.is_contradicted else (_of_friction(lib, test),)


def _of_friction(lib: Library, test: FrictionTest) -> str:
    return (
        f"the residuals of {', '.join(test.names(lib))} contain friction that the columns do not "
        f"describe, a Stribeck peak or friction that grows with the load ({test.excess:.2g} times "
        "the threshold): the parameters take up a part of it, and their intervals are too narrow; "
        "compare with --friction auto"
    )


def _of_gains(lib: Library, test: GainTest) -> str:
    name = lib.joint_names[test.joint]
    return (
        f"the torques of the joints contradict each other, and a torque gain of {test.gain:.2f} "
        f"± {test.sigma:.2g} at {name}, relative to the other joints, explains most of it: the "
        f"torque is wrong rather than the URDF; check the torque constant of {name}, or calibrate "
        "with: python -m runtime gains"
    )


def _of_prior(test: PriorTest, is_torque_wrong: bool) -> str:
    size = f"{test.excess:.2g} times the threshold"
    if not 1 / SCALE < test.scale < SCALE:
        return (
            f"the measured torque is {test.scale:.3g} times that of the URDF: the unit or sign of "
            "the torque is wrong rather than the URDF; state them in a recipe (torque in N·m)"
        )
    if is_torque_wrong:
        return f"the data contradict the URDF as well ({size}); correct the torque first"
    if not test.links:
        return (
            f"the data contradict the inertias of the URDF ({size}), and no single link explains "
            "it: the URDF is of another robot, or the order, unit or sign of the signals is wrong; "
            "check them with: python -m runtime inspect LOG"
        )
    bodies = " or ".join(
        f"{name} ({before:.3g} kg in the URDF, about {after:.3g} kg from the data)"
        for name, (before, after) in zip(test.links, test.masses, strict=True)
    )
    return (
        f"the data contradict the inertia of {bodies}, or of what it carries ({size}), while the "
        "joints agree with each other: the URDF is wrong rather than the log, or the arm carries a "
        'load that it does not contain; correct the URDF, or use --prior with trust = "none"'
    )
