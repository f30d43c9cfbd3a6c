"""posterior.npz: the covariance of the result again, refused where it is damaged or of another."""

from pathlib import Path

import numpy as np
import pytest

from runtime import Recording
from runtime.errors import IdentificationError
from runtime.identification.posterior_file import read_posterior
from runtime.identification.result_file import write_result
from runtime.identification.saved_result import POSTERIOR, read_result
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction


@pytest.fixture
def folder(noisy: Recording, lib: Library, tmp_path: Path) -> Path:
    write_result(identify_recording(noisy, lib, friction=Friction(("viscous",))), tmp_path, "test")
    return tmp_path


def test_the_file_gives_the_covariance_of_the_result(
    noisy: Recording, lib: Library, tmp_path: Path
) -> None:
    """Oracle: C of the result to rounding; that of [β; φ] by the inverse of the whole information.

    Without prior the information of [β; φ] is RᵀR/S. The prior of κ = 16 adds 2 % to it, and the
    error of the estimate has a share of some percent too.
    """
    result = identify_recording(noisy, lib)
    write_result(result, tmp_path, "test")
    posterior = read_posterior(tmp_path, read_result(tmp_path), lib)
    np.testing.assert_array_equal(posterior.pi_root, result.uncertainty.root)
    both, known = posterior.root(lib), posterior.information
    sigma = np.linalg.norm(both, axis=1)
    n_base = len(lib.base_matrix)
    np.testing.assert_allclose(sigma[:n_base], result.uncertainty.beta_sigma, rtol=1e-9)
    factor = known.statistics.factor
    free = np.sqrt(known.density * np.diag(np.linalg.inv(factor.T @ factor)))
    assert (np.abs(sigma[n_base:] / free[n_base:] - 1) < 0.1).all()
    _, system = posterior.reduced(lib)
    change = 1e-3 * np.random.default_rng(0).standard_normal(result.pi.size)
    moved = system.phi(result.pi + change) - system.phi(result.pi)
    np.testing.assert_allclose(posterior.usual(system.slope) @ change, moved, atol=1e-12)


@pytest.mark.parametrize("damage", ["missing", "cut", "nan", "other", "shape"])
def test_damaged_files_are_refused(damage: str, folder: Path, lib: Library) -> None:
    """Property: one sentence that says what to run."""
    path = folder / POSTERIOR
    arrays = dict(np.load(path))
    if damage == "missing":
        path.unlink()
    elif damage == "cut":
        path.write_bytes(path.read_bytes()[:500])
    else:
        if damage == "nan":
            arrays["target"] = arrays["target"] * np.nan
        elif damage == "other":
            arrays["pi"] = 1.001 * arrays["pi"]
        else:
            arrays["factor"] = arrays["factor"][:-1]
        np.savez(path, **arrays)
    with pytest.raises(IdentificationError, match="identify again"):
        read_posterior(folder, read_result(folder), lib)
