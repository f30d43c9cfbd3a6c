"""A robot above the limits of size: kernels without vector code, and those that it does not get."""

import numpy as np
import pytest

from runtime.errors import LibraryError
from runtime.estimators.regression.factor import compress
from runtime.estimators.regression.samples import Samples
from runtime.library import Library, load
from symgen import catalogue
from symgen.chain import model
from symgen.make import pipeline
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest, request_from_folder
from tests.robots import DATA, ONE_LEVEL

TREE = (DATA / "tree.urdf").read_text()


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Library, Library]:
    """The same robot with all kernels, and with limits that it exceeds."""
    root = tmp_path_factory.mktemp("large")
    whole = load(build(BuildRequest("whole", TREE), root, levels=ONE_LEVEL).folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(model, "LARGE", 3)
        patch.setattr(catalogue, "LONG", 150)
        patch.setattr(pipeline, "LONG", 150)
        folder = build(BuildRequest("large", TREE), root, levels=ONE_LEVEL).folder
        again, _ = pipeline.generate(request_from_folder(folder))
    assert again["kernels.c"] == (folder / "kernels.c").read_text()
    return whole, load(folder)


def test_kernels_agree(pair: tuple[Library, Library]) -> None:
    """Oracle: the robot with all kernels as vector code; the same operations in another order."""
    whole, large = pair
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.normal(size=(3, 50, 4))
    facts = large.manifest.kernels
    assert {"regressor", "base_regressor", "torque_jacobian", "forward_dynamics"} <= set(facts)
    lam, pi = whole.lam0, whole.pi0
    tau = whole.inverse_dynamics(q, dq, ddq, pi)
    pairs = [
        (lib.inverse_dynamics(q, dq, ddq, pi),
         lib.torque(q, dq, ddq, lam),
         lib.regressor(q, dq, ddq),
         lib.base_regressor(q, dq, ddq),
         lib.torque_jacobian(q, dq, ddq, lam),
         lib.mass_matrix(q, pi),
         lib.forward_dynamics(q, dq, tau, pi),
         lib.frame_jacobian(q))
        for lib in pair
    ]  # fmt: skip
    for ours, theirs in zip(pairs[1], pairs[0], strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 * np.abs(theirs).max())


def test_omitted_kernels_are_named(pair: tuple[Library, Library]) -> None:
    """Property: every kernel that the large robot lacks has a sentence."""
    whole, large = pair
    lacking = set(whole.manifest.kernels) - set(large.manifest.kernels)
    assert lacking == set(large.manifest.omitted)
    assert {"coriolis_matrix", "momentum_regressor", "torque_derivatives"} <= lacking
    zero = np.zeros(4)
    with pytest.raises(LibraryError, match=r"no kernel 'coriolis_matrix'.*use bias_forces"):
        large.coriolis_matrix(zero, zero, large.pi0)
    with pytest.raises(LibraryError, match=r"no kernel 'regressor_adjoint'.*--base and --tip"):
        large.regressor_adjoint(zero, zero, zero, np.zeros((4, len(large.base_columns))))
    assert "casadi" not in large.levels


def test_statistics_without_compiled_rows(pair: tuple[Library, Library]) -> None:
    """Oracle: the compiled statistics of the robot with all kernels."""
    whole, large = pair
    assert large.compiled_statistics is None
    rng = np.random.default_rng(1)
    q, dq, ddq, tau = rng.normal(size=(4, 80, 4))
    samples = Samples(q, dq, ddq, tau, np.zeros((80, 4, 0)))
    ours, theirs = (compress(lib, samples, np.ones(4)) for lib in (large, whole))
    gap = np.abs(ours.factor - theirs.factor).max()
    assert gap < 1e-10 * np.abs(theirs.factor).max()  # QR in another order, condition 1e2


def test_robots_of_usual_size_keep_all_kernels(fr3: Library) -> None:
    """Property: an arm of seven joints omits nothing."""
    assert fr3.manifest.omitted == {}
