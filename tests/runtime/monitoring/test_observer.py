"""Observer: the momentum observer of the literature, sample by sample and for a whole log."""

import numpy as np
import pinocchio
import pytest

from runtime import Observer, Recording
from runtime.errors import IdentificationError
from runtime.identification.identified import Identification
from runtime.library import Library
from runtime.monitoring.model import model_of
from runtime.monitoring.observer import ObserverSettings, external_torques, observer_settings
from runtime.recording import Friction
from tests.oracle import pinocchio_model, with_parameters
from tests.runtime.monitoring.conftest import Monitored

RATE = 1000.0


def pinocchio_observer(
    lib: Library, pi: np.ndarray, phi: np.ndarray, terms: Friction, log: Recording, bandwidth: float
) -> np.ndarray:
    """r by M, C and g of Pinocchio: Cᵀ dq explicitly, friction and rotors by their equations."""
    model = with_parameters(pinocchio_model(lib.urdf(), lib.gravity), lib, pi)
    data, dt = model.createData(), 1 / RATE
    value = dict(zip(terms.columns, phi.T, strict=True))
    none = np.zeros(lib.n_joints)
    a, r, last, out = np.exp(-bandwidth * dt), np.zeros(lib.n_joints), None, []
    for q, dq, tau in zip(log.q, log.dq, log.tau, strict=True):
        mass = np.array(pinocchio.crba(model, data, q))
        mass = np.triu(mass) + np.triu(mass, 1).T
        coriolis = pinocchio.computeCoriolisMatrix(model, data, q, dq)
        gravity = pinocchio.computeGeneralizedGravity(model, data, q)
        friction = value.get("viscous", none) * dq + value.get("offset", none)
        friction = friction + value.get("coulomb", none) * np.tanh(dq / terms.coulomb_speed)
        p = (mass + np.diag(value.get("rotor", none))) @ dq
        u = tau - friction + coriolis.T @ dq - gravity
        if last is not None:
            r = a * r + (1 - a) * ((p - last[0]) / dt - (u + last[1]) / 2)
        last = p, u
        out.append(r)
    return np.array(out)


@pytest.fixture(scope="module")
def moving(lib: Library, rest_of_log: Recording) -> Recording:
    """Four hundred samples of a real motion on an exact clock."""
    part = rest_of_log.take(slice(2000, 2400), "part")
    return part.replace(t=np.arange(400) / RATE)


@pytest.mark.parametrize("columns", [("viscous", "coulomb", "offset"), ("viscous", "rotor")])
def test_observer_is_that_of_pinocchio(
    columns: tuple[str, ...], lib: Library, monitored: Monitored, moving: Recording
) -> None:
    """Oracle: M, C and g of Pinocchio in the equations of the module, friction and rotors added.

    Tolerance 1e-9 N·m: p of 10 kg·m²/s with 1e-15, over a step of 1 ms.
    """
    import dataclasses

    terms, phi = Friction(columns), monitored.result.phi[:, : len(columns)]
    saved = dataclasses.replace(monitored.saved, friction=terms, phi=phi)
    observer = Observer(lib, saved, rate_hz=RATE, bandwidth=80.0)
    r = [observer.update(*s) for s in zip(moving.q, moving.dq, moving.tau, strict=True)]
    right = pinocchio_observer(lib, saved.pi, phi, terms, moving, 80.0)
    assert np.abs(right).max() > 0.1
    np.testing.assert_allclose(r, right, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("steps", "velocity"), [(0, "measured"), (7, "measured"), (7, "position")])
def test_a_log_and_its_samples_give_the_same(
    steps: int, velocity: str, lib: Library, monitored: Monitored, moving: Recording
) -> None:
    """Property: the program for logs and the one for samples differ by rounding only."""
    settings = ObserverSettings(RATE, 150.0, steps, velocity)
    model = model_of(monitored.result, lib)
    (whole,) = external_torques(lib, model, settings, moving)
    observer = Observer(
        lib,
        monitored.result,
        rate_hz=RATE,
        bandwidth=150.0,
        window_s=steps / RATE,
        velocity=velocity,
    )
    single = np.array(
        [observer.update(*s) for s in zip(moving.q, moving.dq, moving.tau, strict=True)]
    )
    assert np.isnan(whole[: steps + 1]).all()
    np.testing.assert_allclose(single[steps + 1 :], whole[steps + 1 :], rtol=0, atol=1e-8)


def test_r_follows_a_step_of_the_environment(
    lib: Library, ideal_runs: tuple[Recording, ...], pi_true: np.ndarray, panda_adam: Identification
) -> None:
    """Oracle: motors that hold against 5 N·m show τ_ext = 5 N·m, at the rate of `response`."""
    import dataclasses

    exact = dataclasses.replace(panda_adam, pi=pi_true, phi=np.zeros((7, 0)))
    run, start = ideal_runs[0], 300
    pushed = np.zeros_like(run.q)
    pushed[start:, 2] = 5.0
    settings = ObserverSettings(100.0, 20.0)
    model = model_of(exact, lib)
    (r,) = external_torques(lib, model, settings, run.replace(tau=run.tau - pushed))
    # 100 Hz: trapezoids of a motion with 3 Hz leave some 10 mN·m.
    assert np.abs(r[start + 60 :, 2] - 5.0).max() < 0.05
    assert np.abs(np.delete(r, 2, axis=1)[1:]).max() < 0.05
    for k in (5, 10, 20):
        assert r[start + k, 2] == pytest.approx(5 * settings.response((k + 0.5) / 100), abs=0.1)


def test_a_late_torque_belongs_to_an_earlier_state(
    lib: Library, monitored: Monitored, moving: Recording
) -> None:
    """Property: with the delay of the log in its preparation, r is that of torque without delay."""
    import dataclasses

    def run(delay: float, tau: np.ndarray) -> np.ndarray:
        known = dataclasses.replace(monitored.saved.preparation, torque_delay_s=delay or None)
        saved = dataclasses.replace(monitored.saved, preparation=known)
        observer = Observer(lib, saved, rate_hz=RATE)
        rows = zip(moving.q, moving.dq, tau, strict=True)
        return np.array([observer.update(*row) for row in rows])

    plain = run(0.0, moving.tau)
    late = run(0.003, np.vstack([np.tile(moving.tau[0], (3, 1)), moving.tau[:-3]]))
    early = run(-0.003, np.vstack([moving.tau[3:], np.tile(moving.tau[-1], (3, 1))]))
    # The first samples differ; what they leave decays with exp(−100 · 0.3) = 1e-13.
    np.testing.assert_allclose(late[350:], plain[347:-3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(early[350:], plain[350:], rtol=0, atol=1e-9)


def test_response_is_that_of_the_recursion() -> None:
    """Oracle: a step through window and lag, simulated at 1 MHz; 95 % at the stated time."""
    s = observer_settings(1e6, 0.03, 20_000, "measured")
    w = np.minimum(np.arange(60_000) / 20_000, 1.0)
    r = np.zeros_like(w)
    for k in range(1, len(w)):
        r[k] = s.decay * r[k - 1] + (1 - s.decay) * w[k]
    for at in (0.005, 0.02, 0.03, 0.05):
        assert s.response(at) == pytest.approx(r[round(1e6 * at)], abs=1e-3)
    assert s.response(0.03) == pytest.approx(0.95, abs=1e-6)


def test_settings_out_of_range_are_refused(lib: Library, monitored: Monitored) -> None:
    """Property: one sentence that states what came."""
    for wrong in ({"rate_hz": 0.0}, {"rate_hz": 1e3, "bandwidth": -1.0}):
        with pytest.raises(IdentificationError, match="above 0"):
            Observer(lib, monitored.saved, **wrong)
    with pytest.raises(IdentificationError, match="window of 1 steps"):
        Observer(lib, monitored.saved, rate_hz=1e3, velocity="position")
    with pytest.raises(IdentificationError, match="shape"):
        Observer(lib, monitored.saved, rate_hz=1e3).update(*np.zeros((3, 6)))


def test_friction_with_a_memory_follows_the_path(lib: Library, monitored: Monitored) -> None:
    """Oracle: Dahl's equation in 200 steps per sample; r is that of a log without that friction.

    Euler's steps are wrong by their length over z_c: 0.6 mm/200 over 2 mm, of 0.5 N·m.
    """
    import dataclasses

    t = np.arange(800) / RATE
    q = lib.home + 0.1 * np.sin(6 * t)[:, None]
    dq = 0.6 * np.cos(6 * t)[:, None] * np.ones(7)
    zeta, fine = np.zeros_like(q), 200
    for k in range(1, len(t)):
        z, step = zeta[k - 1].copy(), (q[k] - q[k - 1]) / fine
        for _ in range(fine):
            z += (step - np.abs(step) * z) / 0.002
        zeta[k] = z
    tau = np.sin(9 * t)[:, None] * np.ones(7)
    terms = Friction(("dahl",), dahl_stroke=0.002)
    with_memory = dataclasses.replace(monitored.saved, friction=terms, phi=np.full((7, 1), 0.5))
    without = dataclasses.replace(monitored.saved, friction=Friction(()), phi=np.zeros((7, 0)))
    r = []
    for model, torque in ((with_memory, tau + 0.5 * zeta), (without, tau)):
        observer = Observer(lib, model, rate_hz=RATE)
        r.append(np.array([observer.update(*rows) for rows in zip(q, dq, torque, strict=True)]))
    settings = ObserverSettings(RATE)
    log, known = Recording(t, q, dq, tau=tau + 0.5 * zeta), model_of(with_memory, lib)
    (whole,) = external_torques(lib, known, settings, log)
    np.testing.assert_allclose(r[0], r[1], atol=2e-3)
    np.testing.assert_allclose(whole[1:], r[0][1:], atol=1e-8)
    observer.reset()
    np.testing.assert_array_equal(observer.update(q[0], dq[0], tau[0]), 0.0)
