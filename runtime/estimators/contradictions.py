"""Contradictions between data, prior and result, in sentences that say which of them is wrong.

Before any statement of trust: is the torque that of the columns (`column_faults`), which cause
explains what the fit leaves (`regression.causes`), do the torques fit the inertial prior
(`convex.prior_agreement`), does the friction fit its columns, and does the result fit the torques?
At most one of the answers is a doubt; a URDF that is off is none, because the result follows the
data.
"""

from dataclasses import dataclass, field

import numpy as np

from runtime.common.tables import significant
from runtime.estimators.column_faults import column_faults
from runtime.estimators.convex.eliminate_friction import Reduced
from runtime.estimators.convex.entropic_prior import Prior
from runtime.estimators.convex.prior_agreement import LEAST_DENSITY, PriorTest, prior_test
from runtime.estimators.regression.causes import (
    DELAY,
    GAIN,
    OFFSET,
    TILT,
    ZERO,
    Cause,
    Causes,
    causes_of,
)
from runtime.estimators.regression.omitted_columns import FreeFit, FrictionTest, friction_test
from runtime.library import Array, Library
from runtime.library.manifest import torque_units

SCALE = 3.0
"""Factor between measured torque and that of the URDF beyond which the unit of the torque is the
likeliest fault: a load of twice the own weight of an arm stays below it."""
VISIBLE = 0.10
"""Deviation of a torque gain that a log should show; joints whose limit is higher are named."""
LARGEST = np.radians(10.0)
"""Limit of an encoder zero or tilt from which on a log is said not to show it."""
CERTAIN = 3.0
"""Change of the mass of a released link over its σ from which on it is stated."""
FOLLOWS = "; the result follows the data"
"""End of a sentence on a URDF or prior that is off, which is no reason to doubt the result."""
UNFITTED = 2.0
"""Misfit of a result over the threshold of the test of the prior above which the method, and not
the prior, is the cause."""


@dataclass(frozen=True, slots=True, eq=False)
class ModelTests:
    """Results of all tests."""

    # sentence that doubts the result; empty where there is none
    contradictions: tuple[str, ...] = ()
    # sentences on what the data contradict while the result holds: its intervals, the URDF
    model_errors: tuple[str, ...] = ()
    # sentences on gains, encoder zeros and tilts that may be wrong without a trace
    limits: tuple[str, ...] = ()
    causes: Causes = field(default_factory=Causes)  # compared; none where they were not tested


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
    causes = Causes() if fit is None else causes_of(lib, fit, pi)
    friction = None if fit is None else friction_test(fit)
    test = prior_test(lib, data, prior, kappa, density)
    rest = data.factor @ pi - data.target
    misfit = float(rest @ rest) / max(density, LEAST_DENSITY) / test.threshold
    named = tuple(sorted(causes.named, key=lambda cause: not cause.is_plausible))
    # Placeholders for links without <inertial> are no prior that a torque could contradict.
    contradicted = test.is_contradicted and (is_of_type or not lib.placeholders)
    doubt, errors = "", []
    if contradicted or not all(each.is_plausible for each in named):
        doubt = _of_columns(lib, fit)
    if not doubt and contradicted and not 1 / SCALE < test.scale < SCALE:
        doubt = _of_unit(test, is_of_type)
    if named and named[0].is_usable:
        errors.append(
            f"{sentence_of(lib, named)}: the parameters take up a part of it, and their intervals "
            f"are too narrow; {remedy_of(lib, named[0])}"
        )
    elif named:
        doubt = doubt or _of_cause(lib, named)
    if contradicted and not doubt:
        if test.is_of_another and not test.links:
            doubt = _of_prior(test, is_of_type)
        else:
            errors.insert(0, _of_urdf(test, is_of_type))
    if friction is not None and friction.is_contradicted:
        errors.append(_of_friction(lib, friction))
    if not (doubt or test.is_contradicted) and misfit > UNFITTED:
        doubt = (
            f"the result leaves {misfit:.2g} times as much of the training torque unexplained as "
            "its noise and the prior allow, so the method stopped short of the data; use map"
        )
    doubts = (doubt,) if doubt else ()
    return ModelTests(doubts, tuple(errors), _of_limits(lib, causes), causes)


def sentence_of(lib: Library, named: tuple[Cause, ...]) -> str:
    """The cause in words, and those that explain nearly as much."""
    others = " or ".join(_words(lib, each) for each in named[1:] if each.is_plausible)
    beside = f" ({others} explains nearly as much)" if others else ""
    of = "the torques of the joints contradict each other, mostly by"
    if named[0].kind != GAIN:
        of = "the residuals are those of"
    return f"{of} {_words(lib, named[0])}{beside}"


def _words(lib: Library, cause: Cause) -> str:
    """Kind, joint, size and σ of a cause."""
    name = lib.joint_names[cause.joint]
    unit, size = torque_units(lib.manifest)[cause.joint], cause.size
    angle, scale = ("mm", 1e3) if unit == "N" else ("°", 180 / np.pi)
    side = "late" if size > 0 else "early"
    return {
        GAIN: f"a torque gain of {1 + size:.3f} ± {cause.sigma:.1g} at {name}, relative to the "
        "other joints",
        DELAY: f"a torque that is stamped {1e3 * abs(size):.2g} ± {1e3 * cause.sigma:.1g} ms too "
        f"{side} for the motion",
        ZERO: f"an encoder of {name} that reads {scale * size:.2g} ± {scale * cause.sigma:.1g} "
        f"{angle} too much",
        TILT: f"a base that is tilted by {np.degrees(size):.2g} ± {np.degrees(cause.sigma):.1g}°",
        OFFSET: f"a constant torque of {size:.2g} ± {cause.sigma:.1g} {unit} at {name}",
    }[cause.kind]


def remedy_of(lib: Library, cause: Cause) -> str:
    """What to do about a cause."""
    name = lib.joint_names[cause.joint]
    if cause.kind == TILT:
        gravity = ",".join(f"{x:.3f}" for x in lib.gravity + cause.vector)
        return f"measure its angles, or build the robot with --gravity={gravity}"
    return {
        GAIN: f"check the torque constant of {name}, or estimate the gains of all joints by "
        "python -m runtime gains",
        DELAY: "correct it with --delay auto",
        ZERO: f"calibrate the zero of {name}, or estimate it by identify --settings "
        "encoder_bias=true",
        OFFSET: "add offset to the columns of --friction",
    }[cause.kind]


def _of_columns(lib: Library, fit: FreeFit | None) -> str:
    """Sentence on signs and orders of columns, compared as `inspect` does; "" where they hold."""
    if fit is None or fit.samples.acceleration is None or fit.samples.equations != lib.n_joints:
        return ""
    named = column_faults(lib, fit.samples).named
    if not named:
        return ""
    return (
        f"{' and '.join(fault.sentence(lib.joint_names) for fault in named)}, and no torque gain "
        "explains it: the log is wrong rather than the URDF; inspect proposes a recipe that "
        "corrects it"
    )


def _of_cause(lib: Library, named: tuple[Cause, ...]) -> str:
    """Sentence on a cause without which the result predicts other torques."""
    best = named[0]
    if not best.is_plausible:
        name = lib.joint_names[best.joint]
        return (
            f"the torques of the joints contradict each other, most at {name}, and no torque gain "
            "explains it: the torque is wrong rather than the URDF; check order and sign of the "
            f"signals and the friction of {name} with: python -m runtime inspect LOG"
        )
    wrong = {GAIN: "torque", DELAY: "clock of the torque", ZERO: "position"}.get(best.kind, "mount")
    return (
        f"{sentence_of(lib, named)}: the {wrong} is wrong rather than the URDF; "
        f"{remedy_of(lib, best)}"
    )


def _of_limits(lib: Library, causes: Causes) -> tuple[str, ...]:
    """Sentence on gains, encoder zeros and tilts that may be wrong without a trace."""
    hidden = [
        f"{name} ({f'up to {100 * limit:.2g} %' if limit < 1 else 'of any size'})"
        for name, limit in zip(lib.joint_names, causes.limits(GAIN), strict=False)
        if limit > VISIBLE
    ]
    said = []
    if hidden:
        said.append(
            f"this log may not show a wrong torque gain of {', '.join(hidden)}, because friction "
            "and inertia take it up; python -m runtime gains determines it"
        )
    turns = [unit != "N" for unit in torque_units(lib.manifest)]
    zeros = [*zip(lib.joint_names, causes.limits(ZERO), turns, strict=False)]
    parts = [
        f"a tilt of the base from {np.degrees(x):.2g}°" for x in causes.limits(TILT) if x < LARGEST
    ]
    shown = [
        f"of {name} from {np.degrees(x):.2g}°" for name, x, turn in zeros if turn and x < LARGEST
    ]
    if shown:
        parts.append(f"a wrong encoder zero {', '.join(shown)}")
    if parts:
        rest = sum(turn for *_, turn in zeros) - len(shown)
        others = f", and that of {rest} other joints at no angle below {np.degrees(LARGEST):.0f}°"
        said.append(f"this log shows {' and '.join(parts)} on{others if shown and rest else ''}")
    return tuple(said)


def _of_friction(lib: Library, test: FrictionTest) -> str:
    return (
        f"the residuals of {', '.join(test.names(lib))} contain friction that the columns do not "
        f"describe, a Stribeck peak or friction that grows with the load ({test.excess:.2g} times "
        "the threshold): the parameters take up a part of it, and their intervals are too narrow; "
        "compare with --friction auto"
    )


def _of_unit(test: PriorTest, is_of_type: bool) -> str:
    source = _source(is_of_type)
    return (
        f"the measured torque is {test.scale:.3g} times that of {source}: the unit or sign of the "
        f"torque is wrong rather than {source}; state them in a recipe: torque in N·m, or "
        "currents in A with the torque constants of the manufacturer"
    )


def _source(is_of_type: bool) -> str:
    return "the prior of the fleet" if is_of_type else "the URDF"


def _is_certain(before: float, after: float, sigma: float) -> bool:
    """Whether the data determine a mass; near the base a release leaves it to the logarithm."""
    return abs(after - before) > CERTAIN * sigma


def _bodies(test: PriorTest, is_of_type: bool) -> str:
    """Links whose release explains the contradiction, with the masses that the data determine."""
    return " or ".join(
        f"{name} ({before:.3g} kg in {_source(is_of_type)}, {after:.3g} ± {2 * sigma:.1g} kg from "
        "the data)"
        if _is_certain(before, after, sigma)
        else name
        for name, (before, after, sigma) in zip(test.links, test.masses, strict=True)
    )


def _of_urdf(test: PriorTest, is_of_type: bool) -> str:
    """Sentence on a prior that is off, while the result follows the data."""
    source, size = _source(is_of_type), f"{test.excess:.2g} times the threshold"
    missed = f"{significant(100 * test.mismatch)} % of the torque of its links"
    if not test.links:
        return (
            f"{source} is off by {missed}: the data contradict its inertias ({size}), while the "
            f"joints agree with each other{FOLLOWS}"
        )
    before, after, sigma = test.masses[0]
    if _is_certain(before, after, sigma):
        missed = f"{missed}, {after - before:+.2g} kg at {test.links[0]}"
    return (
        f"{source} is off by {missed}: the data contradict the inertia of "
        f"{_bodies(test, is_of_type)}, or of what it carries ({size}), while the joints agree with "
        f"each other: {_wrong(is_of_type)}{FOLLOWS}"
    )


def _wrong(is_of_type: bool) -> str:
    if is_of_type:
        return (
            "this unit differs from its fleet, or carries a load that the others did not; leave "
            "out --prior, or add its statistics to the fleet"
        )
    return (
        "the URDF is wrong rather than the log, or the arm carries a load that it does not contain"
    )


def _of_prior(test: PriorTest, is_of_type: bool) -> str:
    """Sentence on a prior that is further off than that of the same robot, in no single link."""
    source = _source(is_of_type)
    return (
        f"the data contradict the inertias of {source} ({test.excess:.2g} times the threshold), "
        f"and no single link explains it: {source} is of another robot, or order, unit or sign of "
        "the signals are wrong; check them with: python -m runtime inspect LOG"
    )
