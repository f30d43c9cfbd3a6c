"""Friction columns and the torque they stand for."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from runtime.errors import RecordingError
from runtime.recording import Friction, Recording
from runtime.recording.friction.model import add_columns
from runtime.recording.friction.model import columns as friction_columns
from runtime.recording.friction.model import torque as friction_torque
from runtime.recording.settings import COLUMNS, JointMotion
from tests.conftest import REPOSITORY
from tests.plugins import add_toy

NAMES = ("viscous", "coulomb", "offset")


def speed_columns(dq, names=NAMES, eps=0.02):
    """Columns that need the speed alone."""
    return friction_columns(JointMotion(np.asarray(dq)), Friction(tuple(names), eps))


speeds = arrays(np.float64, (5, 3), elements=st.floats(-10, 10))


def test_columns_are_those_of_the_docstring():
    """Oracle: dq, tanh(dq/ε) and 1, in the order asked for, joint by joint."""
    dq = np.array([[0.0, 0.02], [-0.04, 1.0]])
    C = speed_columns(dq, ("offset", "coulomb", "viscous"), 0.02)
    assert C.shape == (2, 2, 3)
    np.testing.assert_array_equal(C[..., 0], 1.0)
    expected = [[0.0, 0.7615941559557649], [-0.9640275800758169, 1.0]]
    np.testing.assert_allclose(C[..., 1], expected, rtol=1e-15)
    np.testing.assert_array_equal(C[..., 2], dq)
    assert speed_columns(dq, ()).shape == (2, 2, 0)


@given(dq=speeds)
def test_friction_is_odd_and_takes_power(dq):
    """Property: viscous and Coulomb friction with φ ≥ 0 is odd in dq and never drives the joint."""
    phi = np.array([[0.1, 0.5], [0.0, 0.3], [2.0, 0.0]])
    tau = friction_torque(speed_columns(dq, ("viscous", "coulomb")), phi)
    mirrored = friction_torque(speed_columns(-dq, ("viscous", "coulomb")), phi)
    np.testing.assert_array_equal(mirrored, -tau)
    assert (tau * dq >= 0.0).all()


def test_torque_is_the_sum_of_columns():
    """Oracle: against the sum written out for one joint."""
    dq = np.linspace(-1, 1, 7)[:, None] * [1.0, 2.0]
    phi = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    tau = friction_torque(speed_columns(dq, NAMES, 0.1), phi)
    np.testing.assert_allclose(
        tau[:, 1], 0.4 * dq[:, 1] + 0.5 * np.tanh(dq[:, 1] / 0.1) + 0.6, rtol=1e-14
    )


def test_coulomb_column_is_smooth_with_slope_one_over_epsilon():
    """Derivative: the Taylor remainder of tanh(dq/ε) at rest falls as h³ (its h² term is 0)."""
    h = np.array([[4e-3], [2e-3], [1e-3]])
    remainder = np.abs(speed_columns(h, ("coulomb",), 0.05)[:, 0, 0] - h[:, 0] / 0.05)
    np.testing.assert_allclose(remainder[:-1] / remainder[1:], 8.0, rtol=0.01)


def test_wrong_names_speeds_and_shapes_are_told():
    """Property: the message names what is wrong and what is valid."""
    dq = np.zeros((4, 2))
    with pytest.raises(RecordingError, match=r"'static'; choose from viscous, coulomb, offset"):
        speed_columns(dq, ("viscous", "static"))
    with pytest.raises(RecordingError, match="coulomb_speed expects a number above 0"):
        speed_columns(dq, NAMES, 0.0)
    with pytest.raises(RecordingError, match=r"shape \(2, 3\) .* got \(3, 2\)"):
        friction_torque(speed_columns(dq, NAMES), np.zeros((3, 2)))
    with pytest.raises(RecordingError, match="expect dq"):
        add_columns(Recording(t=np.arange(4.0), q=dq), Friction(NAMES))


TOY = """
import numpy as np
from runtime.recording.settings import FrictionColumn


def drag(motion, terms):
    return motion.dq * np.abs(motion.dq)


TOY = FrictionColumn("toy", "dq |dq|", drag)
"""


def test_records_state_the_properties_of_their_columns():
    """Oracle: claims about the columns against their equations, on a random motion."""
    rng = np.random.default_rng(0)
    motions = [JointMotion(*(rng.normal(size=(20, 2)) for _ in range(3))) for _ in range(2)]
    total = JointMotion(*(sum(getattr(m, k) for m in motions) for k in ("dq", "q", "ddq")))
    terms = Friction(gear=((1.0, 0.0), (0.5, 1.0)))
    for name in COLUMNS:
        column = COLUMNS[name]
        if name in {"load", "dahl_load", "position"} or column.signals:  # need a robot or a log
            continue
        a, b, both = (column.function(m, terms) for m in (*motions, total))
        if column.is_constant:
            np.testing.assert_array_equal(a, b)
        else:
            assert np.allclose(a + b, both) == column.is_linear
        assert column.model_term in {"", "damping", "friction", "armature"}
        if column.secant is not None:
            speed = motions[0].dq[0]
            slope, constant = column.secant(speed, terms.coulomb_speed)
            np.testing.assert_allclose(slope * speed + constant, a[0], rtol=1e-12)


def test_a_column_of_another_package_is_identified(tmp_path, lib, command, monkeypatch):
    """Property: a toy column found by its entry point is fitted and stands in result.json."""
    (tmp_path / "site").mkdir()
    log = REPOSITORY / "runtime/examples/fr3_simulated.npz"
    options = ["--method", "wls", "--friction", "viscous,toy", "--cutoff", "10", "--out", "out"]
    words = ["identify", log, "--robot", lib.folder, *options]
    bare = command(*words)
    assert "no friction column 'toy'" in bare.out + bare.err
    add_toy(tmp_path / "site", COLUMNS, "toy", TOY, "TOY", monkeypatch)
    run = command(*words)
    assert run.code == 0, run.out + run.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert facts["friction"]["columns"] == ["viscous", "toy"]
    assert np.shape(facts["friction"]["values"]) == (7, 2)
