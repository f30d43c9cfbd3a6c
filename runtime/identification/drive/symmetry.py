"""Left and right side of a robot with mirrored limbs: drives and masses beside each other.

    Δ = x_left − x_right,   z² = Δᵀ (C_left + C_right)⁻¹ Δ  ≤  χ²_m(95 %)

Armature is one number, friction the pair of viscous and Coulomb friction, which a motion often
separates badly and whose covariance counts. Where the sides disagree, the drive of one side
predicts the held-out torque of the other: an error that rises belongs to the robot, one that does
not to intervals that are too narrow. The covariance between the sides is not counted.

With mirrored links as linear priors the right link is the mirror image of the left one,

    m_r = m_l,   (m c)_r = Q (m c)_l,   I_r = Q I_l Qᵀ,   Q = R_rᵀ M R_l

M mirrors the base about a plane through its origin, R_l and R_r turn the axes of the links into
those of the base at q = 0. The plane is that about which the positions of the links are mirrored.

Drives of mirrored joints with motors and gears of one type have tied viscous friction and armature,

    φ_j ~ N(φ̄, (ρ φ̄)²),   φ̄ the mean of the joints that are tied

A motion of nearly constant speeds separates viscous from dry friction badly, and errors of the
friction model, not noise, then make the sides differ: each joint counts alike in the mean. Dry
friction depends on the assembly and stays apart.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from runtime.errors import IdentificationError
from runtime.estimators.convex.newton import ConstraintRow, Constraints
from runtime.estimators.prior_file import PriorFile
from runtime.estimators.problem import FrictionPrior
from runtime.estimators.regression.samples import NORMAL_95, residuals, samples_of
from runtime.identification.drive.result import places_of
from runtime.identification.identified import Identification
from runtime.identification.problem_setup import known_friction
from runtime.identification.result_record import MirroredPair
from runtime.identification.settings import Settings
from runtime.library import Array, Library, parameters

FRICTION = ("viscous", "coulomb")
RISES = 1.05  # error with the other side's drive over the joint's, from which they differ
PLANES = {"yz": (-1.0, 1.0, 1.0), "xz": (1.0, -1.0, 1.0), "xy": (1.0, 1.0, -1.0)}
"""Planes of the base, and the diagonal of M."""
_TURN, _TOLERANCE = 0.3, 1e-3
"""Angle of the joints at which poses are compared [rad, m], and tolerance [m, 1]: a millimetre is
below the rounding of a URDF."""
TIED = ("viscous", "armature")  # keys of a drive that are tied
SPREAD = 0.1  # ρ: motors and gears of one type differ by a tenth, mostly by wear and temperature


def mirrored_joints(names: tuple[str, ...], pairs: tuple[str, ...]) -> tuple[tuple[int, int], ...]:
    """Joints whose names differ in one part."""
    places = []
    for text in pairs:
        left, mark, right = text.partition(":")
        if not (left and mark and right) or left == right:
            raise IdentificationError(
                f"the setting symmetric needs two parts of joint names, such as left:right, got "
                f"'{text}'"
            )
        partners = [
            (i, names.index(name.replace(left, right, 1)))
            for i, name in enumerate(names)
            if left in name and name.replace(left, right, 1) in names
        ]
        if not partners:
            raise IdentificationError(
                f"--settings symmetric={text}: no joint with '{left}' has one with '{right}' in "
                f"its place; the joints are {', '.join(names)}"
            )
        places += partners
    return tuple(dict.fromkeys(places))


def with_sides(result: Identification, pairs: tuple[str, ...]) -> Identification:
    """The result with its sides compared, and a note per pair that disagrees."""
    root, phi = result.friction_root, result.usual_phi
    samples = samples_of(result.test, result.lib)
    rest = -residuals(result.lib, samples, result.pi, result.phi)

    def friction(change: Array) -> Array:
        whole = np.zeros_like(result.phi)  # offsets of several logs are behind the shared columns
        whole[:, : change.shape[1]] = change
        return samples.friction(whole)

    columns = result.friction.columns
    compared, notes = sides_of(result.lib.joint_names, pairs, columns, phi, root, rest, friction)
    return replace(result, symmetric=compared, notes=(*notes, *result.notes))


def sides_of(
    joints: tuple[str, ...],
    pairs: tuple[str, ...],
    columns: tuple[str, ...],
    phi: Array,
    root: Array | None,
    rest: Array,
    friction: Callable[[Array], Array],
) -> tuple[tuple[MirroredPair, ...], tuple[str, ...]]:
    """Comparison of mirrored joints, and notes: φ (n, k) and a root of its covariance (n k, ·).

    rest (N, ·) is the residual of the test rows, joints last, and `friction` what φ adds to them.
    """
    places = mirrored_joints(joints, pairs)
    if root is None:
        raise IdentificationError(
            "the setting symmetric compares drives with their standard deviations, which this "
            "identification does not have; give friction columns, and a method with a posterior"
        )
    by_joint = root.reshape(*phi.shape, -1)
    covariance = np.asarray(by_joint @ np.swapaxes(by_joint, 1, 2))  # NaN where not determined
    places_of_keys = places_of(columns)
    sets = {"armature": ("armature",), "friction": FRICTION}
    kept = {
        name: [places_of_keys[key] for key in keys if key in places_of_keys]
        for name, keys in sets.items()
    }

    def compared(pair: tuple[int, int], name: str, taken: list[int]) -> MirroredPair | None:
        """One quantity of two mirrored joints; None where a value is not determined."""
        values = phi[np.ix_(pair, taken)]
        sigmas = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)[np.ix_(pair, taken)])
        if not np.isfinite(sigmas).all():
            return None
        spread = sum(covariance[j][np.ix_(taken, taken)] for j in pair)
        difference = values[0] - values[1]
        squared = float(difference @ np.linalg.pinv(np.asarray(spread)) @ difference)
        agrees = bool(squared <= chdtri(len(taken), 0.05))
        rise = None
        if not agrees:
            change = np.zeros_like(phi)
            change[np.ix_(pair, taken)] = phi[np.ix_(pair[::-1], taken)] - values
            both = [rest.shape[1] - len(joints) + j for j in pair]
            moved, size = (
                float(np.linalg.norm(x[:, both])) for x in (rest - friction(change), rest)
            )
            rise = moved / max(size, 1e-300)
        left, right = (joints[j] for j in pair)
        sizes = [
            " and ".join(f"{v:.3g} ± {NORMAL_95 * s:.2g}" for v, s in zip(*each, strict=True))
            for each in zip(values, sigmas, strict=True)
        ]
        why = (
            "the error is hardly larger with the drive of the other side, so that the motion does "
            "not show which is right, and the intervals are too narrow"
            if rise is not None and rise < RISES
            else "with the drive of the other side the error of the held-out rows is "
            f"{rise or np.nan:.2f} times as large: the two drives differ"
        )
        return MirroredPair(
            left=left,
            right=right,
            quantity=name,
            values=_pair(values),
            sigma=_pair(sigmas),
            distance=squared**0.5,
            agrees=agrees,
            exchanged_error_ratio=rise,
            sentence=None
            if agrees
            else f"{name} of {left} ({sizes[0]}) and {right} ({sizes[1]}) differ by "
            f"{squared**0.5:.1f} standard deviations; {why}",
        )

    every = tuple(
        each
        for pair in places
        for name, taken in kept.items()
        if taken and (each := compared(pair, name, taken)) is not None
    )
    differ = [each.sentence for each in every if each.sentence is not None]
    note = (
        f"left and right agree within their 95 % intervals in {len(every) - len(differ)} of "
        f"{len(every)} pairs of armature and friction"
    )
    return every, (note, *differ)


def _pair(values: Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
    left, right = values.tolist()
    return tuple(left), tuple(right)


def with_mirrored_links(
    prior: PriorFile | None, lib: Library, symmetric: tuple[str, ...], is_tied: bool
) -> PriorFile | None:
    """Inertial prior, with equations that tie the links of mirrored joints where requested."""
    if not is_tied and not symmetric:
        return prior
    if not is_tied:
        mirrored_joints(lib.joint_names, symmetric)
        return prior
    if not symmetric:
        raise IdentificationError(
            "--settings tie=true needs the names of the mirrored joints, got none; give "
            "--settings symmetric=LEFT:RIGHT"
        )
    usual = prior or PriorFile(None, Constraints())
    rows = (*usual.constraints.equations, *mirrored_links(lib, symmetric))
    return replace(usual, constraints=replace(usual.constraints, equations=rows))


def mirrored_links(lib: Library, pairs: tuple[str, ...]) -> tuple[ConstraintRow, ...]:
    """Equations that tie the links of mirrored joints."""
    places = mirrored_joints(lib.joint_names, pairs)
    of_base = int(lib.manifest.floating)  # the base link comes first
    if lib.n_links != of_base + lib.n_joints:
        raise IdentificationError(
            f"--settings tie=true needs one link per joint, but '{lib.name}' has {lib.n_links} "
            f"links and {lib.n_joints} joints; leave it out, or use com_box and mass of --prior"
        )

    def poses_at(*angles: tuple[int, float]) -> Array:
        """Poses of the links of the joints in the base, with some joints at an angle."""
        q = np.zeros((1, lib.n_rows))
        for joint, angle in angles:
            q[0, lib.n_rows - lib.n_joints + joint] = angle
        return np.asarray(lib.link_poses(q))[0, of_base:]

    poses = poses_at()
    # M of the plane about which the positions of the links are mirrored best.
    sides, origin = np.array(places).T, poses[:, :3, 3]

    def distance(signs: tuple[float, ...]) -> float:
        return float(np.linalg.norm(origin[sides[1]] - origin[sides[0]] * np.array(signs)))

    mirror = np.diag(min(PLANES.values(), key=distance))
    rows: list[ConstraintRow] = []
    for left, right in places:
        turn = poses[right, :3, :3].T @ mirror @ poses[left, :3, :3]
        # The right joint moves its link as the mirrored left one, in one of the directions.
        moved, far = poses_at((right, _TURN))[right], []
        for angle in (_TURN, -_TURN):
            of_left = poses_at((left, angle))[left]
            turned = np.column_stack([mirror @ of_left[:3, :3] @ turn.T, mirror @ of_left[:3, 3]])
            far.append(float(np.abs(turned - moved[:3]).max()))
        if min(far) >= _TOLERANCE:
            raise IdentificationError(
                f"--settings tie=true expects {lib.joint_names[left]} and {lib.joint_names[right]} "
                "to be mirrored about a plane of the base, got joints or links that are not; leave "
                "--settings tie=true out, which compares them only"
            )
        image = mirror_image(turn)
        of_right, of_left = (parameters.link_columns(of_base + joint) for joint in (right, left))
        name = f"{lib.joint_names[left]}:{lib.joint_names[right]}"
        for entry, of_mirror in zip(np.eye(parameters.N_PARAMETERS), image, strict=True):
            row = np.zeros(lib.pi0.size)
            row[of_right], row[of_left] = entry, -of_mirror
            rows.append(ConstraintRow(name, row, 0.0))
    return tuple(rows)


def mirror_image(turn: Array) -> Array:
    """Map of the ten parameters of a body under x → Q x: turn (3, 3) → (10, 10)."""
    image = np.zeros((parameters.N_PARAMETERS, parameters.N_PARAMETERS))
    image[parameters.MASS, parameters.MASS] = 1.0
    image[parameters.FIRST_MOMENT, parameters.FIRST_MOMENT] = turn
    image[parameters.INERTIA, parameters.INERTIA] = parameters.inertia_entries(
        turn @ parameters.inertia_matrix(np.eye(6)) @ turn.T
    ).T
    return image


def identify_tied(
    fit: Callable[[Settings], Identification], settings: Settings, pairs: tuple[str, ...]
) -> Identification:
    """Identify a robot and its drives by a fit of any log, first apart and then tied."""
    first = fit(replace(settings, certify=False))
    columns = first.friction.columns
    # Several logs have offsets of their own behind the columns that they share.
    known = known_friction(first.lib, settings, first.train.column_names or columns, first.friction)
    prior, note = tied_prior(first.lib.joint_names, pairs, columns, first.phi, known)
    result = fit(replace(settings, friction_prior=prior, friction=first.friction))
    kept = tuple(each for each in first.notes if each not in result.notes)
    return replace(result, notes=(note, *kept, *result.notes))


def tied_prior(
    joint_names: tuple[str, ...],
    pairs: tuple[str, ...],
    columns: tuple[str, ...],
    phi: Array,
    known: FrictionPrior | None,
) -> tuple[FrictionPrior, str]:
    """Prior of friction (n, k) that ties mirrored joints over another one, and a note."""
    mean = np.zeros_like(phi) if known is None else known.mean.copy()
    sigma = np.full_like(phi, np.inf) if known is None else known.sigma.copy()
    group = np.arange(len(phi))
    for left, right in mirrored_joints(joint_names, pairs):
        group[group == group[right]] = group[left]
    places = places_of(columns)
    names = tuple(key for key in TIED if key in places)
    for each in np.unique(group):
        joints = np.flatnonzero(group == each)
        for key in names if len(joints) > 1 else ():
            centre = float(phi[joints, places[key]].mean())
            if centre > 0:
                mean[joints, places[key]], sigma[joints, places[key]] = centre, SPREAD * centre
    note = (
        f"{' and '.join(names)} of the joints that the setting symmetric pairs are tied to their "
        f"mean within {100 * SPREAD:.0f} %, and the standard deviations count it; compare the "
        "sides without --settings tie=true"
    )
    return FrictionPrior(mean, sigma), note
