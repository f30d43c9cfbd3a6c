"""The audit of M(q) over the joint box."""

import numpy as np
import pytest

from runtime.identification.evaluation import audit_mass, joint_box
from runtime.library import Library


def test_consistent_bodies_are_proven(fr3: Library) -> None:
    """Property: bound ≤ smallest eigenvalue; the descent ends below 20000 other positions.

    The bodies differ from the URDF's, whose massless last link makes M nearly singular.
    """
    lam = fr3.lam0 + np.random.default_rng(0).normal(0, 0.1, fr3.lam0.shape)
    pi, rotor = fr3.pi_from_lam(lam), np.full(7, 0.02)
    audit = audit_mass(fr3, pi, rotor, samples=500)
    assert audit.proven_bound is not None
    assert 0.02 < audit.proven_bound <= audit.least_eigenvalue
    assert (audit.is_positive_definite, audit.violated_share_95) == (True, 0.0)
    q = np.random.default_rng(1).uniform(*joint_box(fr3), (20000, 7))
    others = np.linalg.eigvalsh(fr3.mass_matrix(q, pi) + 0.02 * np.eye(7))[:, 0].min()
    assert audit.least_eigenvalue <= others
    # The place belongs to the value, to the rounding of M.
    there = np.linalg.eigvalsh(fr3.mass_matrix(audit.at, pi) + 0.02 * np.eye(7))[0]
    assert there == pytest.approx(audit.least_eigenvalue, abs=1e-12)
    assert "proven eigenvalues" in audit.sentence()


def test_other_bodies_are_searched(fr3: Library) -> None:
    """Property: a π with the same β is not proven and has the same M; the rule of three bounds it.

    With 500 positions 1 − 0.05^(1/500) = 0.6 %.
    """
    null = np.eye(70) - np.linalg.pinv(fr3.base_matrix) @ fr3.base_matrix
    moved = fr3.pi0 + 50 * null @ np.random.default_rng(2).normal(size=70)
    rotor = np.full(7, 0.05)
    audit = audit_mass(fr3, moved, rotor, samples=500)
    assert audit.proven_bound is None
    assert audit.violated_share_95 == pytest.approx(0.00597, rel=1e-2)
    # Entries of M are sums of terms of 50 kg·m² here, rounded to 1e-16.
    assert audit.least_eigenvalue == pytest.approx(
        audit_mass(fr3, fr3.pi0, rotor, samples=500).least_eigenvalue, abs=1e-9
    )
    assert "95 % confidence" in audit.sentence()


def test_violations_are_found(fr3: Library) -> None:
    """Property: a π with an indefinite M is named with its position, which shows it."""
    pi = fr3.pi0.copy()
    pi[10 * 3 + 6] -= 1.5  # ZZ of link 4
    audit = audit_mass(fr3, pi, samples=500)
    assert (audit.is_positive_definite, audit.violated_share_95) == (False, None)
    assert np.linalg.eigvalsh(fr3.mass_matrix(audit.at, pi))[0] < 0
    assert "M(q) is not positive definite" in audit.sentence()
