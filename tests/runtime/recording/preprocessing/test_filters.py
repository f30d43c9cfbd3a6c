"""Filters and derivatives against signals known in closed form."""

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.filters import low_pass, moving_average, savitzky_golay
from runtime.recording.preprocessing.segments import differentiate, resample
from tests.runtime.signals import middle, sine


@pytest.mark.parametrize("hz", [1.0, 5.0, 10.0, 14.0, 40.0])
def test_low_pass_gain_and_phase(hz):
    """Oracle: a sine leaves with gain 1/(1 + (f/f_c)⁸) and without delay, below, at, above f_c.

    The tolerance is the warping of the bilinear transform at 1 kHz (tan(πf/f_s) against πf/f_s).
    """
    data = sine(hz)
    inside = middle(data)
    filtered = low_pass(data, 10.0)
    warped = np.tan(np.pi * hz / 1000.0) / np.tan(np.pi * 10.0 / 1000.0)
    gain = 1.0 / (1.0 + warped**8)
    assert gain == pytest.approx(1.0 / (1.0 + (hz / 10.0) ** 8), rel=0.05, abs=1e-5)
    np.testing.assert_allclose(filtered.q[inside], gain * data.q[inside], atol=2e-5)


def test_low_pass_treats_all_signals_alike():
    """Property: a relation τ = a q + b dq + Cφ between signals survives the filter exactly."""
    data = sine(3.0)
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(len(data), 2, 2))
    tau = 2.0 * data.q - 0.1 * data.dq + columns @ [0.3, -0.7]
    data = data.replace(tau=tau, ddq=data.q, columns=columns, column_names=("a", "b"))
    for step in (
        lambda r: low_pass(r, 20.0),
        lambda r: moving_average(r, 0.051),
        lambda r: savitzky_golay(r, 0.051),
        lambda r: resample(r, 730.0, 0.01),
    ):
        f = step(data)
        np.testing.assert_allclose(
            f.tau, 2.0 * f.q - 0.1 * f.dq + f.columns @ [0.3, -0.7], atol=1e-11
        )
        assert not np.array_equal(f.columns, columns)
        assert len(f.history) == 1


def test_low_pass_keeps_constants_and_lines_up_to_the_ends():
    """Oracle: the odd padding makes the filter exact on straight lines, ends included."""
    t = np.arange(2000) / 1000.0
    data = Recording(t=t, q=np.stack([3.0 * t - 1.0, np.full_like(t, 7.0)], axis=1))
    np.testing.assert_allclose(low_pass(data, 10.0).q, data.q, atol=1e-5)
    np.testing.assert_allclose(moving_average(data, 0.051).q, data.q, atol=1e-11)


def test_moving_average_gain():
    """Oracle: the mean over 51 samples multiplies a sine by the Dirichlet kernel, phase 0."""
    data = sine(7.0)
    smooth = moving_average(data, 0.051)
    x = np.pi * 7.0 / 1000.0
    gain = np.sin(51 * x) / (51 * np.sin(x))
    inside = middle(data)
    np.testing.assert_allclose(smooth.q[inside], gain * data.q[inside], atol=1e-12)
    assert "51 samples" in smooth.history[0]


def test_savitzky_golay_is_exact_on_polynomials():
    """Oracle: degree 4 reproduces a quartic, and its derivatives fill dq and ddq."""
    t = np.arange(500) / 100.0
    p = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.3, -0.05])
    data = savitzky_golay(Recording(t=t, q=p(t)[:, None]), 0.21, 4)
    np.testing.assert_allclose(data.q[:, 0], p(t), rtol=1e-9)
    np.testing.assert_allclose(data.dq[:, 0], p.deriv()(t), atol=1e-8)
    np.testing.assert_allclose(data.ddq[:, 0], p.deriv(2)(t), atol=1e-6)
    measured = savitzky_golay(Recording(t=t, q=p(t)[:, None], dq=p.deriv()(t)[:, None]), 0.21, 4)
    np.testing.assert_allclose(measured.ddq[:, 0], p.deriv(2)(t), atol=1e-8)


def test_differentiation_error_falls_as_h_squared():
    """Derivative: halving the step divides the error by four, ends included."""
    errors = []
    for rate in (100.0, 200.0, 400.0):
        t = np.arange(round(2 * rate) + 1) / rate
        done = differentiate(Recording(t=t, q=np.sin(3 * t)[:, None]))
        errors.append(
            (
                np.abs(done.dq[:, 0] - 3 * np.cos(3 * t)).max(),
                np.abs(done.ddq[:, 0] + 9 * np.sin(3 * t))[5:-5].max(),
            )
        )
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert (ratios > 3.7).all()
    assert (ratios < 4.3).all()


def test_measured_derivatives_are_kept_unless_asked():
    """Property: differentiate fills in; only from_position overrides a measurement."""
    data = sine(1.0).replace(ddq=np.full((4000, 2), 5.0))
    assert differentiate(data).dq is data.dq
    assert differentiate(data).ddq is data.ddq
    anew = differentiate(data.replace(dq=np.zeros((4000, 2))), from_position=True)
    np.testing.assert_allclose(anew.dq, data.dq, atol=1e-3)
    with pytest.raises(RecordingError, match=r"expected a log.*got 3"):
        differentiate(3)


def test_coulomb_column_is_filtered_after_tanh():
    """Oracle: the filtered column is the filter of tanh(dq/ε), not tanh of the filtered dq."""
    data = sine(1.0)
    prepared = prepare(
        data, Preparation(filter="butterworth", cutoff_hz=10.0), Friction(("coulomb",), 0.05)
    )
    by_hand = low_pass(data.replace(q=np.tanh(data.dq / 0.05)), 10.0).q
    np.testing.assert_allclose(prepared.columns[..., 0], by_hand, atol=1e-12)
    assert np.abs(np.tanh(prepared.dq / 0.05) - by_hand).max() > 0.05
