"""Covariance of a payload from the arm's model, and the weight of the prior, by direct algebra."""

from dataclasses import replace

import numpy as np
import pytest

from runtime import identify_payload
from runtime.estimators.convex.entropic_prior import CAD, bodies_of, prior_of
from runtime.identification.payload import arm_error
from runtime.identification.payload import estimate as module
from runtime.identification.payload.arm_error import ArmModel, Residual, _products, arm_covariance
from runtime.identification.payload.body import mount_of
from runtime.recording import Friction


@pytest.fixture(scope="module")
def arm(pi_true):
    return ArmModel(pi_true, Friction(()), np.zeros((7, 0)), "the truth")


def test_the_arm_counts_with_what_offsets_and_payload_leave_of_it(ideal_runs, lib, arm):
    """Oracle: projections of the full matrices, offsets as columns; twice the share in energy."""
    run = ideal_runs[0].take(slice(0, None, 10), "Every tenth row.")
    count, noise = len(run), np.linspace(0.5, 2.0, 7)
    Y = lib.regressor(run.q, run.dq, run.ddq)
    columns = Y[:, :, mount_of(lib).columns]
    spread = bodies_of(lib).spread(prior_of(lib, arm.pi).centre) / np.sqrt(CAD)
    links = [Y[:, :, 10 * i : 10 * i + 10] @ spread[i] for i in range(7)]
    model = (np.concatenate(links, axis=2) / noise[:, None]).reshape(7 * count, -1)
    load = (columns / noise[:, None]).reshape(7 * count, -1)
    levels = np.tile(np.eye(7), (count, 1)) / np.sqrt(count)

    def without(matrix, known):
        basis, size, _ = np.linalg.svd(known, full_matrices=False)
        basis = basis[:, size > 1e-6 * size[0]]
        return matrix - basis @ (basis.T @ matrix)

    centred = without(load, levels)
    left = without(without(model, levels), centred)
    rest = np.random.default_rng(5).normal(size=7 * count) + 0.02 * left.sum(axis=1)
    rest = without(without(rest, levels), centred)  # residual of a fit with both
    seen = rest - without(rest, left)
    scale = 2 * (seen @ seen) / np.sum(left**2)
    assert 1e-5 < scale < 0.5
    payload = np.linalg.inv(centred.T @ centred + np.eye(10))
    gain = payload @ centred.T @ model

    errors = rest.reshape(count, 7) * noise
    found = arm_covariance(lib, arm, run, Residual(columns, errors, noise, payload))
    # The directions next to the bound of rank carry a thousandth of the energy.
    np.testing.assert_allclose(found, scale * gain @ gain.T, rtol=1e-3, atol=1e-9 * scale)


def test_the_prior_weighs_one_sample_in_every_pass(ideal_runs, lib, arm, monkeypatch):
    """Property: γ N = κ s², and s² = 1 once the rows are over their noise; 2000 rows, hence 5 %."""
    weights, noise = [], 0.05 * np.random.default_rng(2).normal(size=ideal_runs[0].tau.shape)
    problem = module.convex_problem

    def noted(data, prior, gamma):
        weights.append(gamma * data.count)
        return problem(data, prior, gamma)

    monkeypatch.setattr(module, "convex_problem", noted)
    run = ideal_runs[0]
    identify_payload(run.replace(tau=run.tau + noise), lib, arm=arm, kappa=0.01)
    np.testing.assert_allclose(weights[1:-1], 0.01, rtol=0.05)


def test_what_the_prior_of_the_payload_leaves_is_no_error_of_the_arm(ideal_runs, lib, arm):
    """Property: a residual that the payload's columns explain is along no error of the arm.

    The most probable payload leaves one, where its prior decides; without the projection it is 0.4
    of what it could be.
    """
    run = ideal_runs[0].take(slice(0, None, 10), "Every tenth row.")
    columns = lib.regressor(run.q, run.dq, run.ddq)[:, :, mount_of(lib).columns]
    errors = (columns - columns.mean(axis=0)) @ np.linspace(0.5, 1.0, 10)
    motion = (run.q, run.dq, run.ddq)
    _, left, slope = _products(
        lambda part: lib.regressor(*(x[part] for x in motion)),
        70,
        Residual(columns, errors, np.ones(7), np.eye(10)),
    )
    assert np.abs(slope).max() < 1e-8 * np.linalg.norm(errors) * np.sqrt(np.trace(left))


def test_rows_of_infinite_noise_are_left_out_of_every_block(ideal_runs, lib, monkeypatch):
    """Oracle: the products of the other rows alone, in one block."""
    run = ideal_runs[0].take(slice(0, None, 10), "Every tenth row.")
    motion, count = (run.q, run.dq, run.ddq), len(run)
    errors = np.random.default_rng(6).normal(size=(count, 7))
    noise = np.tile(np.linspace(0.5, 2.0, 7), (count, 1))
    noise[count // 3 : count // 2] = np.inf
    used = np.isfinite(noise[:, 0])

    def products(rows):
        regressor = lib.regressor(*(each[rows] for each in motion))
        load = regressor[:, :, mount_of(lib).columns]
        left = Residual(load, errors[rows], noise[rows], np.eye(10))
        return _products(lambda part: regressor[part], 70, left)

    alone = products(used)
    monkeypatch.setattr(arm_error, "_BLOCK", 64)
    for found, expected in zip(products(slice(None)), alone, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("is_identified", [True, False])
def test_a_model_that_was_given_is_not_advised(arm, is_identified):
    """Property: the note on the arm's error advises a model only where none was identified."""
    known = replace(arm, root=np.eye(3) if is_identified else None)
    (note,) = (each for each in module.notes_of((), 0.5, known, False, 0.0) if "50 % of" in each)
    assert ("identified on the empty arm" in note) != is_identified
