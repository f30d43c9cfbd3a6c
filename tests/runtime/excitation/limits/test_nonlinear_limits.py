"""Limits of the robot as constraints: values against independent formulas, slopes by Taylor."""

import numpy as np
import pinocchio
import pytest

from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.excitation.limits.constraints import LimitRows, constraints, require_rest
from runtime.excitation.limits.nonlinear_limits import Braking, Constraint
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import COSINE, basis_of
from runtime.library import Library
from tests.oracle import pinocchio_model
from tests.taylor import assert_second_order, taylor_slope

EVERYTHING = Safety(table=0.0, box=(0.1, 0.8, -0.6, 0.6, 0.2, 1.0), viscous=(3.0,), coulomb=(0.5,))
KINDS = ("braking", "torque", "torque rate", "tip box", "tip speed", "self-collision", "table")


def result(lib: Library, kind: str, safety: Safety = EVERYTHING) -> Constraint:
    return next(
        constraint for constraint in constraints(lib, lib.home, safety) if constraint.kind == kind
    )


def motions(lib: Library, trajectory: Trajectory, t: np.ndarray) -> np.ndarray:
    return np.stack(trajectory.at(lib, t))


def test_every_kind_is_there(lib: Library) -> None:
    """Property: by default all that the FR3 states; nothing in the document's mode."""
    assert [constraint.kind for constraint in constraints(lib, lib.home, EVERYTHING)] == list(KINDS)
    stated = [constraint.kind for constraint in constraints(lib, lib.home, Safety())]
    assert stated == [kind for kind in KINDS if kind not in {"tip box", "table"}]
    assert constraints(lib, lib.home, None) == ()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("basis", ["cosine", "fourier"])
def test_slopes_by_taylor(
    lib: Library, trajectories: tuple[Trajectory, ...], kind: str, basis: str
) -> None:
    """Derivative: g of three rows at odd instants, through the basis, in a.

    The rows are the largest ones, and coefficients move in proportion to their size, too little
    for another point of a capsule to become the closest.
    """
    rng = np.random.default_rng(7)
    t = np.array([1.234, 3.21, 4.1, 5.9, 6.79, 8.766])
    a = 0.7 * trajectories[0].coefficients
    chosen = basis_of(basis)
    if basis != "cosine":
        a = np.hstack([a, 0.02 * rng.normal(size=a.shape)])
    phi = chosen.at(lib, a.shape[1], t, 10.0)
    rows = LimitRows([result(lib, kind)], lib.home, phi, chosen.is_symmetric)
    largest = np.sort(np.argsort(rows.values(a))[-3:])
    slope = rows.jacobian(a, largest)
    direction = 0.05 * a * rng.normal(size=a.shape)
    for row, number in enumerate(largest):
        measured = taylor_slope(
            lambda x, number=number: rows.values(x.reshape(a.shape))[number],
            a.ravel(),
            direction.ravel(),
            float(slope[row] @ direction.ravel()),
        )
        # Rounding of coefficients of 70 that cancel ends the run of h² two decades early.
        assert_second_order(measured, decades=2.5)


def test_rows_on_demand_are_those_of_the_grid(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Property: numbers lead to the same rows whatever else is asked; all constraints together."""
    a, t = trajectories[0].coefficients, np.linspace(0, 10, 21)
    phi = COSINE.at(lib, 5, t, 10.0)
    rows = LimitRows(constraints(lib, lib.home, EVERYTHING), lib.home, phi, True, tightened=0.01)
    numbers, values, slopes = rows.linearised(a, near=-0.5)
    assert values == pytest.approx(rows.values(a)[numbers], abs=0)
    assert values.min() > -0.5
    some = numbers[::7]
    assert rows.jacobian(a, some) == pytest.approx(slopes[::7], rel=1e-12, abs=1e-12)
    loose = LimitRows(constraints(lib, lib.home, EVERYTHING), lib.home, phi, True)
    # One subtraction.
    assert rows.values(a) - loose.values(a) == pytest.approx(np.full(rows.values(a).shape, 0.01))
    assert rows.worst(a) == rows.values(a).max()


def test_even_laws_see_half_of_a_motion_that_returns(
    lib: Library, trajectories: tuple[Trajectory, ...]
) -> None:
    """Property: the largest g over all t, as on the whole grid."""
    a, t = trajectories[0].coefficients, np.linspace(0, 10, 101)
    phi = COSINE.at(lib, 5, t, 10.0)
    known = constraints(lib, lib.home, EVERYTHING)
    half, whole = (LimitRows(known, lib.home, phi, flag).by_constraint(a) for flag in (True, False))
    for constraint, some, everything in zip(known, half, whole, strict=True):
        assert some.shape[1] == (51 if constraint.even else 101), constraint.kind
        # Two-sided rows swap their signs on the way back; rounding of the mirrored basis.
        assert some.max() == pytest.approx(everything.max(), rel=1e-9)
    assert [constraint.kind for constraint in known if not constraint.even] == [
        "braking",
        "torque",
        "torque rate",
    ]
    assert all(constraint.even for constraint in constraints(lib, lib.home, Safety())[1:])


def test_torque_is_pinocchios(lib: Library, trajectories: tuple[Trajectory, ...]) -> None:
    """Oracle: RNEA of the same URDF, its rate by differences, friction by hand."""
    model = pinocchio_model(lib.urdf())
    data = model.createData()
    t, h = np.array([1.3, 4.4, 7.7]), 1e-5
    effort = 0.95 * lib.limits()["effort"] - 0.5

    def torque(t: np.ndarray) -> np.ndarray:
        q, dq, ddq, _ = trajectories[1].at(lib, t)
        rows = [pinocchio.rnea(model, data, *state) for state in zip(q, dq, ddq, strict=True)]
        return np.array(rows) + 3.0 * dq

    motion = motions(lib, trajectories[1], t)
    g = result(lib, "torque").values(motion)
    assert g[:, :7] == pytest.approx(torque(t) / effort - 1, abs=1e-11)
    assert g[:, 7:] == pytest.approx(-torque(t) / effort - 1, abs=1e-11)
    rate = (torque(t + h) - torque(t - h)) / (2 * h)
    # Central differences: truncation h² × 1e3, rounding 1e-13 / h; over limits of 1000 N·m/s.
    g = result(lib, "torque rate").values(motion)
    assert g[:, :7] == pytest.approx(rate / lib.limits()["torque_rate"] - 1, abs=1e-9)


def test_tip_is_pinocchios(lib: Library, trajectories: tuple[Trajectory, ...]) -> None:
    """Oracle: forward kinematics of the same URDF for the place, differences for the speed."""
    model = pinocchio_model(lib.urdf())
    data = model.createData()
    frame = model.getFrameId(lib.manifest.tip)

    def place(t: np.ndarray) -> np.ndarray:
        rows = []
        for q in trajectories[1].at(lib, t)[0]:
            pinocchio.framesForwardKinematics(model, data, q)
            rows.append(data.oMf[frame].translation.copy())
        return np.array(rows)

    t, h = np.array([1.3, 4.4, 7.7]), 1e-5
    motion = motions(lib, trajectories[1], t)
    g = result(lib, "tip box").values(motion)
    upper, lower = np.array([0.8, 0.6, 1.0]), np.array([0.1, -0.6, 0.2])
    expected = np.hstack([place(t) - upper, lower - place(t)]) / 0.1
    assert g == pytest.approx(expected, abs=1e-11)
    speed = np.linalg.norm((place(t + h) - place(t - h)) / (2 * h), axis=1)
    limit = float(lib.limits()["tip_speed"])
    # Differences as above.
    g = result(lib, "tip speed").values(motion)
    assert g[:, 0] == pytest.approx(((speed / limit) ** 2 - 1) / 2, abs=1e-8)


def test_braking_is_the_manufacturers_speed(lib: Library) -> None:
    """Oracle: |dq| ≤ −c + √(k (q̂ − q)) where that is positive; the same set, on its border."""
    constraint = result(lib, "braking")
    assert isinstance(constraint, Braking)
    facts = lib.braking
    assert facts is not None
    rng = np.random.default_rng(0)
    lower, upper = lib.limits()["lower"], lib.limits()["upper"]
    q = rng.uniform(lower, upper, (200, 7))
    reach = (
        -facts.c + np.sqrt(facts.k * (facts.upper - q)),
        (-facts.c + np.sqrt(facts.k * (q - facts.lower))),
    )
    for side, speed in enumerate(reach):
        sign = 1 - 2 * side
        motion = np.stack([q, sign * speed, 0 * q, 0 * q])
        g = constraint.values(motion)[:, 7 * side : 7 * side + 7]
        some = speed > 0
        assert some.mean() > 0.9
        assert g[some] == pytest.approx(0, abs=1e-13)
        slower = constraint.values(motion - 1e-3 * sign * np.eye(4)[1][:, None, None])
        assert (slower[:, 7 * side : 7 * side + 7][some] < 0).all()
    rest = np.zeros((4, 1, 7))
    rest[0] = lib.home
    assert constraint.values(rest) == pytest.approx(-1, abs=1e-14)  # nothing used at rest at home


def test_distances_keep_their_margins(lib: Library) -> None:
    """Property: zero at the margin, −1 at 0.1 m more; an option replaces all but the narrow ones.

    The distances themselves are tested where they are generated.
    """
    rest = np.zeros((4, 1, 7))
    rest[0] = lib.home
    constraint = result(lib, "self-collision")
    single = np.array([pair.margin for pair in lib.pairs])
    distance = lib.clearance(lib.home)[0].ravel()
    assert constraint.values(rest)[0] == pytest.approx((single - distance) / 0.1, abs=1e-13)
    wide = result(lib, "self-collision", Safety(clearance=0.04)).values(rest)[0]
    expected = np.where(single < single.max(), single, 0.04)
    assert (single < single.max()).any(), "the FR3 has links that are close by design"
    assert wide == pytest.approx((expected - distance) / 0.1, abs=1e-13)
    value, limit, unit = constraint.measured(0, float(constraint.values(rest)[0, 0]))
    assert (value, limit, unit) == (pytest.approx(distance[0]), single[0], "m")
    low = result(lib, "table").values(rest)[0]
    high = result(lib, "table", Safety(table=0.1, clearance=0.05)).values(rest)[0]
    assert high - low == pytest.approx((0.05 + 0.1 - 0.03) / 0.1 * np.ones(len(low)), abs=1e-12)
    assert "link1" not in result(lib, "table").labels  # turns about the vertical


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"torque_fraction": 0.0}, "torque fraction above 0 and up to 1"),
        ({"torque_fraction": np.nan}, "torque fraction above 0 and up to 1 is needed, got nan"),
        ({"clearance": -0.01}, "clearance from 0 m up"),
        ({"clearance": np.nan}, "clearance from 0 m up is needed, got nan"),
        ({"table": np.nan}, "the table needs a finite height"),
        ({"box": (0.1, 0.2)}, "needs xmin, xmax, ymin, ymax, zmin, zmax"),
        ({"box": (0.1, np.nan, 0, 1, 0, 1)}, "needs xmin, xmax, ymin, ymax, zmin, zmax"),
        ({"box": (0.5, 0.4, -1, 1, 0, 1)}, "is empty: x from 0.5 m to 0.4 m"),
        ({"viscous": (-1.0,)}, "viscous friction needs finite numbers"),
        ({"coulomb": (np.inf,)}, "coulomb friction needs finite numbers"),
    ],
)
def test_limits_that_are_none(options: dict[str, object], sentence: str) -> None:
    """Property: one sentence each."""
    with pytest.raises(IdentificationError, match=sentence):
        Safety(**options)


@pytest.mark.parametrize(
    ("safety", "sentence"),
    [
        (Safety(box=(0.6, 0.8, -1, 1, 0, 1)), r"tip box limit of x min is already broken.*too far"),
        (Safety(table=0.5), "table limit of link.* is already broken"),
        (Safety(viscous=(1.0, 2.0)), "needs one number or one per joint, 7, got 2"),
        (Safety(coulomb=(90.0,)), "Coulomb friction of 90 N·m exceeds the torque of 'fr3_joint5'"),
        (
            Safety(torque_fraction=0.05),
            "torque limit of fr3_joint4 is already broken: 18.96 N·m where 4.35",
        ),
        (Safety(clearance=0.3), "self-collision limit of .* is already broken"),
    ],
)
def test_limits_that_home_breaks(lib: Library, safety: Safety, sentence: str) -> None:
    """Property: which limit, where and by how much, in one sentence."""
    with pytest.raises(IdentificationError, match=sentence):
        require_rest(constraints(lib, lib.home, safety), lib.home)


def test_a_home_on_a_limit(lib: Library) -> None:
    """Property: rounding of the tip's place is not called a broken limit, nor shown as one."""
    p = lib.tip_motion(lib.home[None], np.zeros((1, 7)))[0][0]
    for shift in (0.0, 1e-17, 5e-11):
        box = Safety(box=(p[0] + shift, 2.0, -2.0, 2.0, -2.0, 2.0))
        with pytest.raises(
            IdentificationError, match=r"x min, .* is already reached and leaves no"
        ):
            require_rest(constraints(lib, lib.home, box), lib.home)
    box = Safety(box=(p[0] + 1e-6, 2.0, -2.0, 2.0, -2.0, 2.0))
    with pytest.raises(IdentificationError, match="x min is already broken"):
        require_rest(constraints(lib, lib.home, box), lib.home)


def test_a_home_without_speed_is_reported(lib: Library) -> None:
    """Property: at the very end of the range the FR3 may not move."""
    facts = lib.braking
    assert facts is not None
    home = lib.home.copy()
    home[3] = facts.upper[3] - 0.005
    with pytest.raises(IdentificationError, match=r"'fr3_joint4' its velocity limit.*no speed"):
        require_rest(constraints(lib, home, Safety()), home)


def test_without_constraints_no_motion_is_evaluated() -> None:
    """Property: a grid of an hour takes no memory for the motion where no limit needs it."""
    rows = LimitRows([], np.zeros(2), np.zeros((5, 3, 4)), half=False)
    rows.motion = None  # type: ignore[assignment,method-assign]  it is not called
    assert rows.worst(np.ones((2, 3))) == -1.0
