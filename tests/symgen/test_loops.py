"""Closed loops: equations against an independent projection, choices at the assembly, sentences."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from symgen.catalogue import make_catalogue
from symgen.chain.mechanism import mechanism_from_table, table_from_mechanism
from symgen.cli import main
from symgen.errors import UrdfError
from symgen.make.facts import initial_parameters
from symgen.mechanics.loop_equations import closed_chain, seed_values, values_from_last
from symgen.mechanics.loop_range import within_loops
from tests.linkages import Linkage, Projection, planar
from tests.loop_equations import MAKERS, chain_of, differences, states
from tests.oracle import Array
from tests.taylor import taylor_slope

EXACT = 1e-8
"""Bound of the acceptance; measured are 1e-13 to 1e-11, rounding times the condition of φ_d."""


@pytest.mark.parametrize("kind", MAKERS)
def test_equations_are_those_of_the_projected_tree(kind: str) -> None:
    """Oracle: positions, τ, ddq and Y equal KKT equations of Pinocchio's tree; Y = Y_b K."""
    assert max(differences(MAKERS[kind](np.random.default_rng(3)), 5)) < EXACT


def test_derivatives_and_adjoints_follow_the_loop() -> None:
    """Derivative: ∂τ/∂q, dτ/dt, its adjoint and the adjoint of Y_b have Taylor remainders of h²;
    M is ∂τ/∂ddq. They differentiate g(q), G and Ġ by the implicit function theorem.
    """
    chain = within_loops(chain_of(planar(np.random.default_rng(2), "five-bar")))
    kernels = {k.name: k.function for k in make_catalogue(chain).kernels}
    rng = np.random.default_rng(0)
    (q,), (dq,), (ddq,) = states(chain, 1, rng)
    pi, _ = initial_parameters(chain, False)

    def call(name: str, *values: Array) -> list[Array]:
        out = kernels[name](*values)
        return [np.asarray(o).ravel() for o in (out if isinstance(out, tuple) else (out,))]

    _, slope, _, mass = call("torque_derivatives", q, dq, ddq, pi)
    v = rng.normal(0, 0.3, 2)
    found = taylor_slope(
        lambda x: call("inverse_dynamics", x, dq, ddq, pi)[0], q, v, slope.reshape(2, 2) @ v, 0.1
    )
    assert found.decades > 2
    np.testing.assert_allclose(call("mass_matrix", q, pi)[0], mass, rtol=1e-10, atol=1e-12)
    dddq, seed = rng.normal(0, 5, (2, 2))
    gradient = call("torque_rate_adjoint", q, dq, ddq, dddq, pi, seed)[0].reshape(4, 2)
    found = taylor_slope(
        lambda x: seed @ call("torque_rate", x, dq, ddq, dddq, pi)[0], q, v, gradient[0] @ v, 0.1
    )
    assert found.decades > 2
    seeds = rng.normal(0, 1, kernels["regressor_adjoint"].numel_in(3))
    gradient = call("regressor_adjoint", q, dq, ddq, seeds)[0].reshape(3, 2)
    found = taylor_slope(
        lambda x: seeds @ call("base_regressor", x, dq, ddq)[0], q, v, gradient[0] @ v, 0.1
    )
    assert found.decades > 2
    # τ = dp/dt − r of the regressors without accelerations, by the chain rule along the motion
    h = 1e-4
    ahead, back = (
        call("momentum_regressor", q + s * h * dq + h * h * ddq / 2, dq + s * h * ddq)[0]
        for s in (1, -1)
    )
    force = call("momentum_regressor", q, dq)[1]
    np.testing.assert_allclose(
        (ahead - back) / (2 * h) - force, call("base_regressor", q, dq, ddq)[0], atol=1e-4
    )


def test_the_last_sample_leads_to_the_same_pose() -> None:
    """Property: Newton from a pose 0.05 rad away ends where the continuation ends; from the other
    branch of the linkage, beyond the singular posture, the pose is refused.
    """
    linkage = planar(np.random.default_rng(3), "four-bar")
    chain = within_loops(chain_of(linkage))
    oracle = Projection(linkage, ("a1", "a2", "b1"), np.zeros(3))
    q, d = ca.SX.sym("q", 1), ca.SX.sym("d", 2)
    far = ca.Function("far", [q], list(seed_values(closed_chain(chain), q)))
    near = ca.Function("near", [q, d], list(values_from_last(closed_chain(chain), q, d)))
    assert chain.loops is not None
    at = np.array(chain.loops.assembly)[list(chain.loops.independent)]
    last = np.asarray(far(at)[0])[:2]
    after, margin = far(at + 0.05)
    np.testing.assert_allclose(near(at + 0.05, last)[0], after, atol=1e-14)
    assert float(margin) > 0
    # mirrored at the line between the ends of crank and rocker: the other branch
    a1, a2, b1 = chain.loops.assembly
    elbow, ground = (
        -length * np.array([np.cos(angle), np.sin(angle)])
        for length, angle in ((linkage.ends[0][1][0], a1 + a2), (linkage.ends[1][1][0], b1))
    )
    along = (ground - elbow) / np.linalg.norm(ground - elbow)
    tip = 2 * (elbow - (elbow @ along) * along)
    other = np.array([np.arctan2(*(tip - end)[::-1]) for end in (elbow, ground)]) - [a1, 0]
    assert np.isnan(np.asarray(near(at, other)[0])).any()
    assert np.abs(oracle.gap(np.array([a1, *other]))[0]).max() < 1e-12


def test_ranges_keep_away_from_singular_postures() -> None:
    """Property: every posture of the range closes with a margin; just beyond the singular posture,
    where crank and coupler are in line, the pose is refused.
    """
    chain = chain_of(planar(np.random.default_rng(3), "five-bar"))
    narrowed = within_loops(chain)
    q = ca.SX.sym("q", 2)
    margin = ca.Function("m", [q], [seed_values(closed_chain(chain), q)[1]])
    inside, _, _ = states(narrowed, 300, np.random.default_rng(0))
    margins = np.asarray(margin.map(300)(inside.T)).ravel()
    assert margins.min() > 0.05
    around = np.random.default_rng(1).uniform(-np.pi, np.pi, (300, 2))
    assert np.isnan(np.asarray(margin.map(300)(around.T))).any()


def test_the_kind_follows_from_the_frames() -> None:
    """Property: frames that coincide with their axes are fixed where joints are left to move, else
    their origins coincide; a welded parallelogram of four joints has one degree of freedom.
    """
    linkage = planar(np.random.default_rng(3), "parallelogram")
    hinged = chain_of(linkage)
    assert hinged.loops is not None
    assert hinged.loops.closures[0].kind == "spherical"
    assert len(hinged.coordinates) == 1
    tip = (
        '<link name="T"><inertial><mass value="0.1"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" '
        'ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="t" type="continuous"><parent '
        'link="A2"/><child link="T"/><origin xyz="{x} 0 0"/><axis xyz="0 0 1"/></joint></robot>'
    )
    (_, point), (_, end) = linkage.ends
    welded = Linkage(
        linkage.urdf.replace("</robot>", tip.replace("{x}", str(point[0]))),
        {"loop": [{"parent": "B1", "child": "T", "parent_xyz": end.tolist()}]},
        (),
        {},
        linkage.ends,
    )
    start = linkage.start
    pose = start | {"t": start["b1"] - start["a1"] - start["a2"]}
    chain = chain_of(welded, assembly=pose)
    assert chain.loops is not None
    assert chain.loops.closures[0].kind == "fixed"
    assert [j.name for j in chain.coordinates] == ["a1"]
    assert len(chain_of(welded, assembly=pose, independent=["a1", "t"]).coordinates) == 2


def test_a_mechanism_with_loops_survives_the_manifest() -> None:
    """Property: the table of the manifest reads as the mechanism it was written from."""
    loop = {"parent": "A", "child": "B", "child_rpy": [0, 0, 1], "kind": "revolute"}
    table = {"loop": [loop, {"parent": "A", "child": "C"}], "assembly": {"j": 0.5}}
    mechanism = mechanism_from_table(table, "M")
    assert mechanism_from_table(table_from_mechanism(mechanism), "again") == mechanism


BAR = planar(np.random.default_rng(3), "four-bar")
LOOP = BAR.mechanism["loop"][0]
REFUSED = {
    "unknown link": ({"loop": [LOOP | {"child": "nobody"}]}, "the link 'nobody'"),
    "too short": (
        {"loop": [LOOP | {"parent_xyz": [9.0, 0, 0]}]},
        r"cannot be closed: its frames are .* m \(.* in the parent's frame\) apart at the start",
    ),
    "off the plane": (
        {"loop": [LOOP | {"parent_xyz": [LOOP["parent_xyz"][0], 0, 0.003]}]},
        r"0\.003 m \(0, 0, -0\.003 in the parent's frame\) where Newton ends",
    ),
    "the second loop": (
        {"loop": [LOOP, LOOP | {"parent_xyz": [9.0, 0, 0], "child": "ground"}], "independent": []},
        "the loop of 'A2' and 'ground' cannot be closed",
    ),
    "a lock of loop and coupling": (
        {"loop": [LOOP], "coupling": [{"joint": "b1", "of": {"a1": 1.0}}], "independent": []},
        "and the couplings no joint can move|cannot be closed",
    ),
    "one body": ({"loop": [LOOP | {"child": "A2"}]}, "do not move relative to each other"),
    "no freedom": (
        {"loop": [LOOP | {"kind": "fixed"}], "independent": []},
        "no joint can move|cannot be closed",
    ),
    "unknown kind": ({"loop": [LOOP | {"kind": "glued"}]}, "kind = 'glued'"),
    "unknown key": ({"loop": [LOOP | {"xyz": [0, 0, 0]}]}, "unknown key 'xyz'"),
    "no child": (
        {"loop": [{"parent": "A2"}]},
        r"expects the key child in loop\[0\], got none; add it",
    ),
    "a word": (
        {"loop": [LOOP | {"parent_xyz": ["a", 0, 0]}]},
        r"loop\[0\].parent_xyz\[0\] expects a number, got 'a'; correct it",
    ),
    "axis": ({"loop": [LOOP | {"axis": [0, 0, 0]}]}, "axis 0 0 0"),
    "unknown independent": ({"independent": ["z"]}, "independent names 'z'"),
    "too many independent": ({"independent": ["a1", "b1"]}, "do not determine the others"),
    "unknown assembly": ({"assembly": {"z": 1.0}}, r"\[assembly\] names 'z'"),
    "assembly of words": (
        {"assembly": {"a1": "up"}},
        r"assembly.a1 expects a number, got 'up'; correct it",
    ),
    "assembly far away": ({"assembly": {"b1": 1e308}}, r"b1 = 1e\+308, expected at most 1000"),
    "assembly as a list": (
        {"assembly": [1.0]},
        r"assembly expects a table, got \[1.0\]; correct it",
    ),
    "table, not tables": ({"loop": LOOP}, "loop expects a list, got {.*; correct it"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_loop_is_refused_in_a_sentence(case: str) -> None:
    """Property: one sentence that names the loop, the link or the key."""
    changes, sentence = REFUSED[case]
    with pytest.raises(UrdfError, match=sentence) as caught:
        chain_of(BAR, **changes)
    assert "\n" not in str(caught.value)


def test_a_singular_assembly_is_refused() -> None:
    """Property: a parallelogram whose links lie on one line can go on in two ways."""
    linkage = planar(np.random.default_rng(3), "parallelogram")
    flat = {"a1": 0.0, "a2": 0.0, "b1": 0.0}
    with pytest.raises(UrdfError, match=r"assembly pose of the loop of 'A2' and 'B1' is singular"):
        chain_of(linkage, assembly=flat)


def test_a_wrong_loop_ends_the_build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: exit code 2 and one sentence; nothing is written."""
    (tmp_path / "bar.urdf").write_text(BAR.urdf)
    (tmp_path / "bar.toml").write_text(
        '[[loop]]\nparent = "A2"\nchild = "B1"\nparent_xyz = [9.0, 0.0, 0.0]\n'
    )
    arguments = ["build", "--urdf", tmp_path / "bar.urdf", "--name", "bar"]
    arguments += ["--mechanism", tmp_path / "bar.toml", "--out", tmp_path / "out"]
    monkeypatch.setattr("sys.argv", ["symgen", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert "the loop of 'A2' and 'B1' cannot be closed" in said
    assert "Traceback" not in said
    assert not (tmp_path / "out").exists()
