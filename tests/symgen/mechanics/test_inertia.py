"""λ ↔ π ↔ M ↔ P of one body, at ordinary, degenerate and impossible inertias."""

import casadi as ca
import numpy as np
import pinocchio
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from symgen.errors import InertiaError
from symgen.mechanics import inertia
from tests.taylor import Array

EPS = float(np.finfo(float).eps)

_lam, _pi, _floor = ca.SX.sym("lam", 10), ca.SX.sym("pi", 10), ca.SX.sym("floor")
_slope = ca.SX.sym("slope", 10)
PI = ca.Function("pi", [_lam], [inertia.pi_from_lam(_lam)])
LAM = ca.Function("lam", [_pi], [inertia.lam_from_pi(_pi)])
NEAREST = ca.Function("near", [_pi, _floor], [inertia.nearest_realisable(_pi, _floor)])
SPATIAL = ca.Function("M", [_lam], [inertia.spatial_inertia(_lam)])
JACOBIAN = ca.Function("J", [_lam], [ca.jacobian(inertia.pi_from_lam(_lam), _lam)])
ADJOINT = ca.Function(
    "g", [_lam, _slope], [inertia.pi_adjoint(_lam, inertia.lam_frame(_lam), _slope)]
)
PSEUDO = ca.Function("P", [_pi], [inertia.pseudo_inertia(_pi)])

PI_7_AS_PRINTED = [1.2543, 0.0057, 0.0108, -0.0203, 0.0009, 0.0008, 0.0003, -0.0001, 0.0002, 0.0004]
"""Link 7 of Table B.4: four decimals of a thin body are no body."""


def call(function: ca.Function, *values: object) -> Array:
    result = np.array(function(*values))
    return result.ravel() if result.shape[1] == 1 else result


def point_cloud(lam: Array) -> Array:
    """π of six point masses m/6 at c ± √3 R e_k (a, b, c)_k /√m: second moments a², b², c²."""
    mass, com, omega, widths = np.exp(lam[0]), lam[1:4], lam[4:7], lam[7:10]
    r = pinocchio.exp3(omega)
    pi = np.zeros(10)
    for k in range(3):
        for sign in (-1, 1):
            x = com + sign * np.sqrt(3 / mass) * widths[k] * r[:, k]
            i = mass / 6 * (x @ x * np.eye(3) - np.outer(x, x))
            m = mass / 6
            pi += [m, *(m * x), i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    return pi


width = st.floats(0, 0.5)
small = st.floats(-1, 1)
bodies = st.builds(
    lambda mu, com, direction, angle, widths: np.array(
        [mu, *com, *(angle * direction / np.linalg.norm(direction)), *widths]
    ),
    st.floats(-5, 4),
    st.tuples(small, small, small),
    st.tuples(small, small, small)
    .map(np.array)
    .map(lambda v: v if np.linalg.norm(v) > 1e-3 else np.array([0.0, 0.0, 1.0])),
    st.one_of(st.floats(0, np.pi), st.sampled_from([0.0, 1e-9, np.pi - 1e-7, np.pi])),
    st.one_of(
        st.tuples(width, width, width),
        width.map(lambda a: (a, a, a)),  # sphere
        width.map(lambda a: (a, 0.0, 0.0)),  # rod
        st.tuples(width, width).map(lambda ab: (*ab, 0.0)),  # plate
        width.map(lambda a: (a, 1e-3 * a, 0.0)),  # thin blade, perhaps far from the origin
        st.just((0.0, 0.0, 0.0)),  # point mass
        st.tuples(width, width).map(lambda ab: (ab[0], ab[1], ab[1])),  # cylinder
    ),
)


@given(bodies)
def test_pi_is_that_of_a_point_cloud(lam: Array) -> None:
    """Oracle: six point masses with the same second moments, at random and degenerate bodies."""
    cloud = point_cloud(lam)
    # Sums of some ten products, relative to the largest entry.
    np.testing.assert_allclose(call(PI, lam), cloud, rtol=0, atol=32 * EPS * np.abs(cloud).max())


@given(bodies, st.lists(st.floats(-1e3, 1e3), min_size=10, max_size=10))
@example(np.array([0.0, 0.1, 0.2, 0.3, 1e-100, 0.0, -1e-101, 0.1, 0.2, 0.3]), [1.0] * 10)
@example(np.array([0.0, 0.1, 0.2, 0.3, 0.0, 2 * np.pi, 0.0, 0.1, 0.2, 0.3]), [1.0, -2.0] * 5)
@example(np.array([1.0, 0.1, 0.2, 0.3, 20.0, -30.0, 10.0, 0.1, 0.2, 0.3]), [-1.0, 3.0] * 5)
def test_adjoint_in_closed_form(lam: Array, slope: list[float]) -> None:
    """Oracle: CasADi's derivative of π(λ), times the slope, at tiny, ordinary and large turns."""
    jacobian = call(JACOBIAN, lam)
    wanted = jacobian.T @ np.array(slope)
    # 43 roundings of the largest sum of magnitudes are the most that 20 000 random bodies showed.
    scale = 256 * EPS * np.max(np.abs(jacobian).T @ np.abs(slope))
    np.testing.assert_allclose(call(ADJOINT, lam, slope), wanted, rtol=0, atol=scale)


@given(bodies)
@example(np.array([0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1e-4, 5e-5, 0.0]))
@example(np.array([0.0, 0.1, 0.7, -0.9, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
@example(np.array([0.0, *[0.0] * 6, 0.25, 0.05193492155647096, 0.05193492155647096]))
@example(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.75, 0.5, 0.0, 0.0]))  # a rod
def test_lam_reproduces_pi(lam: Array) -> None:
    """Property: π(λ(π)) = π, a ≥ b ≥ c ≥ 0 and |ω| ≤ π, whatever the body; none is refused."""
    pi = call(PI, lam)
    back = call(LAM, pi)
    assert np.isfinite(back).all()
    a, b, c = back[7:]
    assert a >= b >= c >= 0
    assert np.linalg.norm(back[4:7]) <= np.pi * (1 + EPS)
    again = call(PI, back)
    assert back[0] == pytest.approx(lam[0], abs=4 * EPS * (1 + abs(lam[0])))
    np.testing.assert_allclose(back[1:4], lam[1:4], rtol=0, atol=4 * EPS)
    # Rounding of π, of the eigenproblem, and what the tolerance of realisability clips.
    trace = pi[4:7].sum()
    scale = 64 * EPS * np.abs(pi).max() + 2 * inertia.REALISABLE_TOLERANCE * trace
    np.testing.assert_allclose(again, pi, rtol=0, atol=scale)


@given(bodies)
def test_widths_are_reproduced(lam: Array) -> None:
    """Property: sorted (a, b, c) come back where they are not lost to cancellation."""
    pi = call(PI, lam)
    squares = np.sort(lam[7:] ** 2)[::-1]
    back = call(LAM, pi)[7:]
    # I_com is a difference of entries as large as m|c|², so a² carries their rounding.
    scale = 64 * EPS * np.abs(pi).max() + 2 * inertia.REALISABLE_TOLERANCE * squares[0]
    np.testing.assert_allclose(back**2, squares, rtol=0, atol=scale)


@given(bodies)
def test_pseudo_inertia_of_any_lam_is_realisable(lam: Array) -> None:
    """Property: P(π(λ)) ⪰ 0 for every λ, and its entries are those of Eqs. 3.9, 3.10."""
    pi = call(PI, lam)
    p = call(PSEUDO, pi)
    np.testing.assert_array_equal(p, p.T)
    assert np.linalg.eigvalsh(p)[0] >= -64 * EPS * np.trace(p)
    np.testing.assert_array_equal(p[:3, 3], pi[1:4])
    assert p[3, 3] == pi[0]
    i = np.trace(p[:3, :3]) * np.eye(3) - p[:3, :3]
    expected = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    np.testing.assert_allclose(pi[4:], expected, rtol=0, atol=8 * EPS * np.trace(p))


@given(bodies)
def test_spatial_inertia(lam: Array) -> None:
    """Oracle: pinocchio's 6×6 of the same body; symmetric and positive (errata to Eq. 4.14)."""
    m = call(SPATIAL, lam)
    np.testing.assert_array_equal(m, m.T)
    mass, com = np.exp(lam[0]), lam[1:4]
    r, squares = pinocchio.exp3(lam[4:7]), lam[7:] ** 2
    at_com = r @ np.diag(squares.sum() - squares) @ r.T
    theirs = pinocchio.Inertia(mass, com, at_com).matrix()
    np.testing.assert_allclose(m, theirs, rtol=0, atol=32 * EPS * np.abs(theirs).max())


@pytest.mark.parametrize(
    "axis", [(1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0), (0.6, 0, 0.8), (-0.36, 0.48, 0.8)]
)
def test_half_turned_principal_axes(axis: tuple[float, float, float]) -> None:
    """Property: principal frames turned by exactly π lose nothing."""
    lam = np.array([0.3, 0.1, -0.2, 0.3, *(np.pi * np.array(axis)), 0.3, 0.2, 0.1])
    pi = call(PI, lam)
    np.testing.assert_allclose(
        call(PI, call(LAM, pi)), pi, rtol=0, atol=16 * EPS * np.abs(pi).max()
    )


@given(bodies, st.floats(1e-8, 1e-2))
def test_nearest_realisable_keeps_what_is_realisable(lam: Array, floor: float) -> None:
    """Property: idempotent up to its floor; bodies above the floor stay as they are."""
    pi = call(PI, lam)
    once = call(NEAREST, pi, floor)
    # Raising three eigenvalues by `least` raises the next floor by 3·floor·least, moments by twice.
    least = floor * (lam[7:] ** 2).sum() + np.exp(lam[0]) * inertia.THINNEST**2
    scale = 64 * EPS * np.abs(pi).max()
    np.testing.assert_allclose(
        call(NEAREST, once, floor), once, rtol=0, atol=8 * floor * least + scale
    )
    if (lam[7:] ** 2).min() > 1.01 * least:
        np.testing.assert_allclose(once, pi, rtol=0, atol=scale)


@given(
    st.floats(0.01, 50),
    st.lists(st.floats(-1, 1), min_size=9, max_size=9),
    st.sampled_from([0.0, 1e-8, 1e-4]),
)
def test_nearest_realisable_repairs_anything(mass: float, rest: list[float], floor: float) -> None:
    """Property: any π with m > 0 becomes a body, with the same mass and centre of mass."""
    pi = np.array([mass, *rest])
    repaired = call(NEAREST, pi, floor)
    assert repaired[0] == mass
    np.testing.assert_allclose(repaired[1:4], pi[1:4], rtol=2 * EPS, atol=0)
    assert np.isfinite(call(LAM, repaired)).all()
    inertia.require_realisable(ca.DM(repaired), "any")
    sigma = call(LAM, repaired)[7:] ** 2
    # The thinnest allowed body, to the rounding of I about a far origin.
    scale = 64 * EPS * np.abs(repaired).max() + 2 * inertia.REALISABLE_TOLERANCE * sigma[0]
    assert sigma.min() >= mass * inertia.THINNEST**2 - scale


def test_nearest_realisable_is_nearest() -> None:
    """Oracle: clipping the eigenvalues of Σ_com by numpy is the Frobenius projection."""
    pi = np.array([2.0, 0.2, -0.1, 0.3, 0.3, 0.1, 0.05, 0.02, -0.03, 0.01])
    p = call(PSEUDO, pi)
    sigma = p[:3, :3] - np.outer(pi[1:4], pi[1:4]) / pi[0]
    values, vectors = np.linalg.eigh(sigma)
    assert values[0] < 0
    least = 1e-4 * values[values > 0].sum() + pi[0] * inertia.THINNEST**2
    clipped = vectors @ np.diag(np.maximum(values, least)) @ vectors.T
    expected = clipped + np.outer(pi[1:4], pi[1:4]) / pi[0]
    repaired = call(PSEUDO, call(NEAREST, pi, 1e-4))
    np.testing.assert_allclose(repaired[:3, :3], expected, rtol=0, atol=1e-15)


def test_printed_link_7_is_no_body() -> None:
    """Oracle: Table B.4's printed link 7 has min eig P₇ = −2.3e-5 (errata) and has no λ."""
    pi = np.array(PI_7_AS_PRINTED)
    assert np.linalg.eigvalsh(call(PSEUDO, pi))[0] == pytest.approx(-2.3e-5, abs=0.05e-5)
    assert np.isnan(call(LAM, pi)).any()
    with pytest.raises(
        InertiaError, match=r"link 'link7' is not physically consistent: .* --settings project=true"
    ):
        inertia.require_realisable(ca.DM(pi), "link7")


@pytest.mark.parametrize(
    ("pi", "message"),
    [
        ([0.0, *[0.0] * 9], "needs a positive mass, got 0 kg"),
        ([-1.0, 0, 0, 0, 1, 1, 1, 0, 0, 0], "needs a positive mass, got -1 kg"),
        ([float("nan"), 0, 0, 0, 1, 1, 1, 0, 0, 0], "needs a positive mass"),
        ([1.0, *[0.0] * 9], "has a mass but zero inertia"),
        # Zero inertia about a centre of mass that lies away from the origin.
        ([3.0, 0.9, 0.3, -2.1, 1.5, 1.74, 0.3, -0.09, 0.63, 0.21], "has a mass but zero inertia"),
        ([1.0, 0, 0, 0, 1.0, 1.0, 2.1, 0, 0, 0], r"by 0\.1 kg\*m\^2"),
    ],
)
def test_impossible_bodies_are_named(pi: list[float], message: str) -> None:
    """Property: the message names the link and what is wrong with it."""
    with pytest.raises(InertiaError, match=message) as caught:
        inertia.require_realisable(ca.DM(pi), "elbow")
    assert "'elbow'" in str(caught.value)


def test_a_point_becomes_a_millimetre_wide() -> None:
    """Oracle: 1 mm of standard deviation along every axis, as documented; no constant of ours.

    A point of 2 kg: Σ_com = 2 · (1e-3)² 1, so that I_com = 2 Σ_com = 4e-6 kg·m² about each axis.
    """
    point = np.array([2.0, 0.2, 0.0, -0.4, *(2.0 * np.array([0.04, 0.05, 0.01, 0.0, 0.02, 0.0]))])
    found = call(NEAREST, point, 0.0)
    np.testing.assert_allclose(found[:4], point[:4], rtol=0, atol=1e-15)
    c = point[1:4] / 2.0
    com = 2.0 * (c @ c * np.eye(3) - np.outer(c, c)) + 4e-6 * np.eye(3)
    wanted = com[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    # Rounding of m|c|² = 0.1 kg·m².
    np.testing.assert_allclose(found[4:], wanted, rtol=0, atol=1e-15)


@pytest.mark.parametrize(("excess", "is_body"), [(3e-13, True), (1e-11, False)])
def test_rounding_is_forgiven_and_no_more(excess: float, is_body: bool) -> None:
    """Property: a triangle inequality broken by less than 1e-12 is rounding, by 1e-11 not."""
    j = np.array([0.5, 0.5, 1.0])  # a plate: the third moment is the sum of the others
    trace = j.sum()
    pi = np.array([1.0, 0, 0, 0, j[0], j[1], j[2] + 2 * excess * trace, 0, 0, 0])
    found = call(LAM, pi)
    assert np.isfinite(found).all() == is_body
    if is_body:
        assert found[9] == 0.0


def test_a_thin_body_far_away_is_a_body() -> None:
    """Property: the rounding of m|c|² at a kilometre, far above the inertia, is forgiven."""
    for x in (900.0, 1000.0, 1100.0):
        pi = call(PI, [0.1, x, 2 * x, -x, 0.3, 0.2, 0.1, 1e-2, 1e-2, 0.0])
        inertia.require_realisable(ca.DM(pi), "far")


def test_every_entry_has_a_name_and_a_unit() -> None:
    """Oracle: the units by hand, entry by entry."""
    pi = dict(zip(inertia.PI_NAMES, inertia.PI_UNITS, strict=True))
    lam = dict(zip(inertia.LAM_NAMES, inertia.LAM_UNITS, strict=True))
    assert (pi["m"], pi["mX"], pi["mZ"], pi["XX"], pi["YZ"]) == (
        *("kg", "kg*m", "kg*m", "kg*m^2", "kg*m^2"),
    )
    assert (lam["mu"], lam["x"], lam["z"]) == ("ln(kg)", "m", "m")
    assert (lam["omega1"], lam["omega3"], lam["a"], lam["c"]) == (
        *("rad", "rad", "kg^0.5*m", "kg^0.5*m"),
    )
