"""Standard deviations that identification will reach with given samples.

    least squares:  C_β = (A_bᵀ A_b)⁻¹ u             A: W^½ [Y_b K] less its part along friction
    MAP:            C_π = (AᵀA / u + κ B)⁻¹ + d dᵀ   B: curvature of the entropic prior
    payload:        (A_kᵀ A_k)⁻¹ u                   A_k: ten columns of the last link, offsets free

W = diag σ⁻². u = N / N_eff is the variance inflation by correlated residuals; it decreases in
proportion to the time for which the same motion continues. Earlier logs are further rows over β.
d is the distance of the model of a log from its data (`runtime.estimators.uncertainty`).

Residuals show little of wrong gains of the torque sensors, whose error is

    τ̂_j = (1 + g_j) τ_j  ⇒  δπ = Σ_j s_j g_j,   s_j = C A_jᵀA_j π / u

A_j are the weighted rows of joint j without their part along its friction columns, C is the
posterior covariance by the rows of all joints. Gains that are equal scale the model, Σ_j s_j ≈ π,
and leave no residual.

The gain of recording more is 1 − σ_after / σ_now. The same motion adds information in proportion
to time, and σ of parameters that the data determine decreases like 1/√t; another motion has another
rate.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from runtime.common.tables import Table
from runtime.estimators.convex.entropic_prior import CAD, Prior, com_sigma, prior_of, spread_of
from runtime.estimators.problem import Fit
from runtime.estimators.regression.factor import Reduced, Statistics, compress, reduce
from runtime.estimators.regression.posterior import DETERMINED
from runtime.estimators.regression.samples import Samples
from runtime.estimators.uncertainty import vague_posterior
from runtime.excitation.search.criteria import covariance, sizes
from runtime.excitation.search.information import information
from runtime.excitation.search.prediction import payload_sigma, unit_payload_sentence
from runtime.identification.expected_accuracy.planned_samples import MotionSamples, with_earlier
from runtime.identification.free_base.result import FreeBaseIdentification
from runtime.library import Array, Library
from runtime.library.parameters import MASS, N_PARAMETERS, PI_NAMES, inertia, links, mass
from runtime.recording.friction.columns import OFFSET

PAYLOAD_MASS = "payload mass"  # name that is listed first where it gains
ARM_ERROR = 0.03  # relative error of an arm's links for which the error of a payload is stated


@dataclass(frozen=True, slots=True)
class Knowledge:
    """Knowledge before the motion."""

    prior: Prior  # inertial prior
    pi: Array  # parameters at which its curvature is taken, (10 n,), strictly consistent
    kappa: float = CAD  # weight of the prior
    earlier: Array | None = None  # information G₀ on β of earlier logs, (n_b, n_b); None for none
    payload_only: bool = False  # the arm is known and only the payload of the last link not
    # distance of the model of a log from its data with hardly any prior, (10 n,); more of the same
    # motion does not reduce it. None for a planned motion
    error: Array | None = None

    @classmethod
    def of(cls, lib: Library) -> "Knowledge":
        """Knowledge of the URDF alone."""
        prior = prior_of(lib)
        return cls(prior, prior.centre)


@dataclass(frozen=True, slots=True)
class ExpectedPayload:
    """Expected standard deviations of a payload of 1 kg on the last link of a known arm."""

    pi: Array  # of the ten parameters, (10,) SI
    com: Array  # of the centre of mass, (3,) m
    of_arm: Array  # of pi without an empty run, from an arm whose links are `ARM_ERROR` off


@dataclass(frozen=True, slots=True)
class Expected:
    """Expected standard deviations after the motion."""

    base: Array | None  # of β by least squares, (n_b,) SI; None where the motion lacks some of β
    base_map: Array  # of β by MAP, (n_b,) SI
    relative: Array  # base_map over the size of β, (n_b,)
    pi: Array  # of π by MAP, (10 n,) SI
    share: Array  # posterior over prior variance of π, (10 n,), in (0, 1]
    com: Array  # of the centres of mass by MAP, (n, 3) m
    root: Array  # root of the mean squared error of π, (10 n, 10 n), with a further column for d
    payload: ExpectedPayload | None = None  # None where the motion lacks some of its parameters

    def by_name(self, lib: Library, payload_only: bool = False) -> dict[str, float]:
        """Standard deviations with names: payload, links, base parameters."""
        named = {}
        if self.payload is not None:
            named[PAYLOAD_MASS] = float(mass(self.payload.pi))
            named["payload CoM"] = float(np.linalg.norm(self.payload.com))
            if payload_only:
                named["payload inertia"] = float(np.linalg.norm(inertia(self.payload.pi)))
        if payload_only:
            return named
        rows = zip(lib.link_names, links(self.pi), self.com, strict=True)
        for link, sigma, com in rows:
            named[f"mass of {link}"] = float(mass(sigma))
            named[f"CoM of {link}"] = float(np.linalg.norm(com))
            named[f"inertia of {link}"] = float(np.linalg.norm(inertia(sigma)))
        return named | dict(zip(base_names(lib), self.base_map.tolist(), strict=True))


def base_names(lib: Library) -> tuple[str, ...]:
    """Names of the base parameters, by the standard parameter that each is regrouped around."""
    places = [divmod(column, N_PARAMETERS) for column in lib.base_columns]
    return tuple(f"base {PI_NAMES[k]} of {lib.link_names[link]}" for link, k in places)


def expected(
    lib: Library,
    statistics: Statistics,
    known: Knowledge,
    unit: float = 1.0,
    columns: tuple[str, ...] | None = None,
) -> Expected:
    """Standard deviations that identification reaches with given samples."""
    whole = _rows(lib, statistics, known.earlier, unit)
    spread = spread_of(known.prior.bodies, known.pi, whole, known.kappa)
    root = spread.root if known.error is None else np.column_stack([spread.root, known.error])
    sigmas = expected_of_root(lib, known.pi, root, spread.share, whole)
    if columns is None:
        return sigmas
    return replace(sigmas, payload=_payload(lib, statistics, known, unit, columns))


def expected_of_root(lib: Library, pi: Array, root: Array, share: Array, rows: Array) -> Expected:
    """Standard deviations by a root of the covariance of π, and by rows over π without prior."""
    over_base = rows[:, list(lib.base_columns)]
    base = covariance(over_base.T @ over_base)  # None where rows are rank deficient to rounding
    base_map = np.linalg.norm(lib.base_matrix @ root, axis=1)
    return Expected(
        base=None if base is None else np.sqrt(np.diag(base)),
        base_map=base_map,
        relative=base_map / sizes(lib, information(lib)),
        pi=np.linalg.norm(root, axis=1),
        share=share,
        com=np.array([each for each in com_sigma(root, pi) if each is not None]),
        root=root,
    )


def _payload(
    lib: Library, statistics: Statistics, known: Knowledge, unit: float, columns: tuple[str, ...]
) -> ExpectedPayload | None:
    """σ of the last link as a payload, friction but for the offsets known; None if undetermined."""
    frozen = np.array([name != OFFSET.name for name in columns] * lib.n_joints, dtype=bool)
    free, earlier = statistics.without(frozen), known.earlier if known.payload_only else None
    rows = _rows(lib, free, earlier, unit)[:, -N_PARAMETERS:]
    spread = covariance(rows.T @ rows)
    if spread is None:
        return None
    whole = _rows(lib, free, None, 1.0)
    gain = np.linalg.lstsq(whole[:, -N_PARAMETERS:], whole, rcond=None)[0]  # G = A_k⁺ A
    # The root of the prior's spread at κ = 1 stands for 100 % of every direction.
    arm = ARM_ERROR * block_diag(*known.prior.bodies.spread(known.prior.centre))
    of_arm = np.linalg.norm(gain @ arm, axis=1)
    return ExpectedPayload(np.sqrt(np.diag(spread)), payload_sigma(spread)[1], of_arm)


def _rows(lib: Library, statistics: Statistics, earlier: Array | None, unit: float) -> Array:
    """A / √u over π, with the rows of earlier logs, (m, 10 n)."""
    data: Reduced = reduce(statistics, lib.n_joints)[0]
    return with_earlier(data.factor / np.sqrt(unit), earlier, lib)


def error_of_fit(lib: Library, samples: Samples, fit: Fit) -> Array:
    """Distance of a model from its data with hardly any prior, (10 n,), as `identify` counts it."""
    weights, noise = fit.noise()
    data, _ = reduce(fit.statistics or compress(lib, samples, weights), samples.equations)
    scale = np.sqrt(max(noise.density, np.finfo(float).tiny))
    reference, _ = vague_posterior(lib, prior_of(lib), data.factor / scale, data.target / scale)
    return fit.pi - reference


def facts(sigma: Expected, lib: Library, payload_only: bool = False) -> dict[str, object]:
    """Standard deviations for JSON files."""
    payload = sigma.payload and {
        "mass": float(mass(sigma.payload.pi)),
        "com": sigma.payload.com.tolist(),
        "pi": sigma.payload.pi.tolist(),
        "mass_of_arm_error": float(mass(sigma.payload.of_arm)),
    }
    if payload_only:
        return {"payload": payload}
    rows = zip(lib.link_names, links(sigma.pi), sigma.com, links(sigma.share), strict=True)
    return {
        "base_parameters": {
            "names": list(base_names(lib)),
            "least_squares": None if sigma.base is None else sigma.base.tolist(),
            "map": sigma.base_map.tolist(),
            "map_relative": sigma.relative.tolist(),
        },
        "links": {
            name: {
                "mass": float(mass(each)),
                "com": com.tolist(),
                "inertia": inertia(each).tolist(),
                "share_of_prior_variance": share.tolist(),
            }
            for name, each, com, share in rows
        },
        "payload": payload,
    }


def payload_sentence(sigma: Expected, alone: bool) -> str:
    """Sentence on the expected accuracy of a payload."""
    if sigma.payload is None:
        return "note: a payload on the last link is not identifiable: too few joints turn it"
    sentence = (
        f"{unit_payload_sentence(float(mass(sigma.payload.pi)), sigma.payload.com)}, against "
        "an empty run of the same motion; without one, an arm whose links are "
        f"{100 * ARM_ERROR:g} % off its model adds "
        f"±{1000 * mass(sigma.payload.of_arm):.3g} g to the mass"
    )
    if not alone:
        return sentence
    sigmas = " ".join(f"{value:.2g}" for value in inertia(sigma.payload.pi))
    return f"{sentence}, inertia xx yy zz xy xz yz about the link's origin to ±({sigmas}) kg·m²"


def base_table(sigma: Expected, lib: Library) -> Table:
    """Expected σ of every base parameter, the largest relative to its value first."""
    names, base = base_names(lib), sigma.base
    rows = tuple(
        (
            names[k].removeprefix("base "),
            "not identifiable" if base is None else f"{base[k]:.3g}",
            f"{sigma.base_map[k]:.3g}",
            f"{100 * sigma.relative[k]:.2f}",
        )
        for k in np.argsort(-sigma.relative)
    )
    title = "base parameters: expected σ, the largest relative σ first"
    return Table(("around", "least squares", "MAP", "MAP % of value"), rows, title=title)


def link_table(sigma: Expected, lib: Library) -> Table:
    """Expected σ of mass, centre of mass and inertia of every link by MAP."""
    bodies = zip(lib.link_names, links(sigma.pi), sigma.com, links(sigma.share), strict=True)
    rows = tuple(
        (
            name,
            f"{1000 * mass(pi):.2f}",
            " ".join(f"{1000 * value:.2f}" for value in com),
            f"{inertia(pi).max():.2g}",
            f"{np.sum(share < DETERMINED)} of {N_PARAMETERS}",
        )
        for name, pi, com, share in bodies
    )
    head = ("link", "mass g", "CoM mm", "inertia kg·m²", "from the data")
    return Table(head, rows, title="links: expected σ with the URDF as prior")


def gain_slopes(
    lib: Library, moved: MotionSamples, sigma: Array, known: Knowledge, unit: float = 1.0
) -> Array:
    """Change s of the parameters per relative error of each torque gain, (10 n, n).

    Earlier logs are taken to change in the same way: the sensors are the same.
    """
    n = lib.n_joints
    alone = [reduce(moved.statistics(lib, sigma, only=j), n)[0].factor for j in range(n)]
    root = spread_of(
        known.prior.bodies, known.pi, np.vstack(alone) / np.sqrt(unit), known.kappa
    ).root
    pulls = np.column_stack([rows.T @ (rows @ known.pi) for rows in alone]) / unit
    return np.asarray(root @ (root.T @ pulls))


def unseen_torque(over_base: Array, unseen: Array) -> Array:
    """RMS torque error (n,) of motions of mean Y_bᵀ Y_b (n, n_b, n_b), by errors of β (n_b, m)."""
    return np.sqrt([np.sum(over_base * (joint @ over_base)) for joint in unseen])


WORTHWHILE = 0.10  # gain above which further recording is recommended
SECONDS = (10.0, 30.0, 60.0)  # further recording times that are evaluated by default, s
_NAMED = 3
KNOTS = 24  # number of instants, closer together at the beginning, where σ decreases fastest
SOONEST = 0.02  # first instant, as a share of the motion


@dataclass(frozen=True, slots=True)
class GainOfRecording:
    """Gain of some more seconds of recording."""

    seconds: float  # further recording time, s
    motion: str  # "the same motion", or the name of another one
    gains: Mapping[str, float]  # name → 1 − σ_after/σ_now; 1 is exact; the largest first

    @property
    def gaining(self) -> tuple[str, ...]:
        """Names whose gain exceeds `WORTHWHILE`."""
        return tuple(name for name, gain in self.gains.items() if gain > WORTHWHILE)

    @property
    def sentence(self) -> str:
        """One sentence on the values that improve, and by how much."""
        if not self.gaining:
            name, gain = next(iter(self.gains.items()))
            return (
                f"{self.seconds:g} s more of {self.motion} improve no value by "
                f"{_percent(WORTHWHILE)} % (most: {name} by {_percent(gain)} %)"
            )
        first = sorted(self.gaining, key=lambda name: name != PAYLOAD_MASS)[:_NAMED]
        named = [f"{name} by {_percent(self.gains[name])} %" for name in first]
        rest = len(self.gaining) - len(named)
        if rest:
            more = f"{rest} more of {len(self.gains)} numbers"
            named.append(f"{more} by over {_percent(WORTHWHILE)} %")
        listed = " and ".join([", ".join(named[:-1]), named[-1]]) if named[1:] else named[0]
        return f"{self.seconds:g} s more of {self.motion} improve {listed}"


def gained(
    now: Mapping[str, float], later: Mapping[str, float], seconds: float, motion: str
) -> GainOfRecording:
    """Gains between two sets of standard deviations."""
    gains = {name: 1.0 - after / now[name] if name in now else 1.0 for name, after in later.items()}
    # Gains that differ by rounding keep the order of the names.
    order = sorted(gains, key=lambda name: -round(gains[name], 3))
    return GainOfRecording(seconds, motion, {name: gains[name] for name in order})


def verdict(gains: Sequence[GainOfRecording]) -> str:
    """One sentence on the shortest time with a gain, else on the longest: go on, or stop."""
    in_time = sorted(gains, key=lambda gain: gain.seconds)
    best = next((gain for gain in in_time if gain.gaining), in_time[-1])
    return f"{best.sentence}: {'go on' if best.gaining else 'stop'}"


def gain_table(steps: Sequence[GainOfRecording]) -> Table:
    """Improvement of σ by more recording: payload, largest, and count of those above 10 %."""
    names = sorted(name for name in steps[0].gains if name.startswith("payload"))
    rows = []
    for step in steps:
        top, gain = next(iter(step.gains.items()))
        cells = (f"{100 * x:.1f}" for x in (*(step.gains[name] for name in names), gain))
        rows.append(
            (f"{step.seconds:g} s", *cells, f"{len(step.gaining)} of {len(step.gains)}", top)
        )
    head = ("more", *names, "largest", "above 10 %", "largest gain of")
    return Table(head, tuple(rows), title=f"expected gain of σ by more of {steps[0].motion}, %")


def _percent(gain: float) -> str:
    return f"{100 * gain:.0f}"


def growth(
    lib: Library,
    moved: MotionSamples,
    noise: Array,
    known: Knowledge,
    unit: float,
    *,
    more: MotionSamples | None = None,
    until: float = 0.0,
) -> tuple[Array, list[Expected]]:
    """Instants of a motion and after its end (k,) [s], and what is expected at each of them.

    noise (n,) [N·m, N]; after its end `more` follows, by default the same motion.
    """
    length = moved.seconds
    within = np.geomspace(SOONEST * length, length, KNOTS)
    beyond = length + np.linspace(0.0, until, KNOTS // 2 + 1)[1:] if until else np.zeros(0)
    whole = moved.statistics(lib, noise)
    sigmas = []
    for now in (*within, *beyond):
        if now <= length:
            statistics = moved.statistics(lib, noise, now)
        else:
            statistics = whole.merged((more or moved).statistics(lib, noise, now - length))
        sigmas.append(expected(lib, statistics, known, unit, moved.columns))
    return np.concatenate([within, beyond]), sigmas


TOTAL_MASS = "total mass"  # name of the mass of a robot with a free base


def expected_of_walk(result: FreeBaseIdentification, seconds: float = 0.0) -> Expected:
    """σ of the rows of a walk that were fitted, and of some seconds of the same motion after it.

    More of the same motion adds rows in proportion to time, while offsets of sensors stay constant,
    so that their share of σ stays, too.
    """
    evidence = result.evidence
    _, reduced, _, spread = evidence.after(1.0 + seconds / evidence.seconds)
    rows = reduced.factor / np.sqrt(evidence.level)
    return expected_of_root(result.lib, result.pi, spread.root, spread.by_kappa.share, rows)


def named_of_walk(result: FreeBaseIdentification, sigma: Expected) -> dict[str, float]:
    """Standard deviations with names: total mass, links, base parameters."""
    total = float(np.linalg.norm(sigma.root[MASS::N_PARAMETERS].sum(axis=0)))
    return {TOTAL_MASS: total} | sigma.by_name(result.lib)
