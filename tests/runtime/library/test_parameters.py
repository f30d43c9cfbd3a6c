"""Accessors to π and λ against the compiled kernels, which do not read them."""

import numpy as np

from runtime.library import Library
from runtime.library import parameters as p


def test_parts_of_pi_are_those_of_the_pseudo_inertia(fr3: Library) -> None:
    bodies, pseudo = p.links(fr3.pi0), fr3.pseudo_inertia(fr3.pi0)
    np.testing.assert_array_equal(p.mass(bodies), pseudo[:, 3, 3])
    np.testing.assert_array_equal(p.first_moment(bodies), pseudo[:, :3, 3])
    np.testing.assert_allclose(p.centre_of_mass(bodies) * p.mass(bodies)[:, None], pseudo[:, :3, 3])
    # XX + YY + ZZ = 2 tr Σ; the products of inertia are −Σ off the diagonal
    inertia, sigma = p.inertia(bodies), pseudo[:, :3, :3]
    np.testing.assert_allclose(inertia[:, :3].sum(axis=1), 2 * np.trace(sigma, axis1=1, axis2=2))
    off_diagonal = np.stack([sigma[:, 0, 1], sigma[:, 0, 2], sigma[:, 1, 2]], axis=1)
    np.testing.assert_allclose(inertia[:, 3:], -off_diagonal, atol=1e-18)


def test_parts_of_lam_are_those_of_the_body(fr3: Library) -> None:
    log_mass, centre, rotation, axes = p.lam_parts(p.links(fr3.lam0))
    bodies = p.links(fr3.pi_from_lam(fr3.lam0))
    np.testing.assert_allclose(np.exp(log_mass), p.mass(bodies))
    np.testing.assert_allclose(centre, p.centre_of_mass(bodies))
    assert rotation.shape == axes.shape == (fr3.n_joints, 3)
    # tr Σ_com = a² + b² + c̄², and tr I = 2 (tr Σ_com + m |c|²)
    moment = 2 * (axes**2).sum(axis=1) + 2 * p.mass(bodies) * (centre**2).sum(axis=1)
    np.testing.assert_allclose(p.inertia(bodies)[:, :3].sum(axis=1), moment)


def test_joining_the_parts_gives_the_whole(fr3: Library) -> None:
    body, lam = p.links(fr3.pi0)[2], p.links(fr3.lam0)[2]
    parts = (float(p.mass(body)), p.first_moment(body), p.inertia(body))
    np.testing.assert_array_equal(p.pi_from_parts(*parts), body)
    np.testing.assert_array_equal(p.lam_from_parts(*p.lam_parts(lam)), lam)


def test_the_columns_of_a_link_are_its_parameters(fr3: Library) -> None:
    for index, body in enumerate(p.links(fr3.pi0)):
        np.testing.assert_array_equal(fr3.pi0[p.link_columns(index)], body)
