"""Typed methods of the kernels of one body: π and λ are (10 L,), or (N, 10 L)."""

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import NotRealisableError, ShapeError
from runtime.library.binding import Array, Binding
from runtime.library.parameters import N_PARAMETERS


class BodyKernels:
    """Maps between λ, π and the matrices of inertia, link by link."""

    n_links: int
    link_names: tuple[str, ...]
    _binding: Binding

    def pi_from_lam(self, lam: ArrayLike) -> Array:
        """π of every link from λ. Source: Eqs. 4.25–4.31."""
        flat = self._links("lam", lam)
        return self._binding.call("pi_from_lam", flat)[0].reshape(np.shape(lam))

    def pi_jacobian(self, lam: ArrayLike) -> Array:
        """∂π_k/∂λ_k, (L, 10, 10) or (N, L, 10, 10)."""
        blocks = self._binding.call("pi_jacobian", self._links("lam", lam))[1]
        return blocks.reshape(*np.shape(lam)[:-1], self.n_links, N_PARAMETERS, N_PARAMETERS)

    def pi_from_cholesky(self, theta: ArrayLike) -> Array:
        """π of every link from log-Cholesky θ, P = U(θ) U(θ)ᵀ. Source: Rucker & Wensing 2022."""
        flat = self._links("theta", theta)
        return self._binding.call("cholesky_jacobian", flat)[0].reshape(np.shape(theta))

    def cholesky_jacobian(self, theta: ArrayLike) -> Array:
        """∂π_k/∂θ_k, (L, 10, 10) or (N, L, 10, 10)."""
        blocks = self._binding.call("cholesky_jacobian", self._links("theta", theta))[1]
        return blocks.reshape(*np.shape(theta)[:-1], self.n_links, N_PARAMETERS, N_PARAMETERS)

    def cholesky_from_pi(self, pi: ArrayLike) -> Array:
        """Log-Cholesky θ of every link; NaN where P is not positive definite."""
        flat = self._links("pi", pi)
        return self._binding.call("cholesky_from_pi", flat)[0].reshape(np.shape(pi))

    def pi_adjoint(self, lam: ArrayLike, slope: ArrayLike) -> Array:
        """(∂π/∂λ)ᵀ slope, link by link: ∂cost/∂λ (10 L,) from ∂cost/∂π. Source: Eq. 4.32.

        Args:
            lam: (10 L,) or (N, 10 L) coordinates λ of the links.
            slope: ∂cost/∂π, shape of λ.

        Returns:
            ∂cost/∂λ, shape of λ.
        """
        links, slopes = self._links("lam", lam), self._links("slope", slope)
        frame = self._binding.call("pi_frame", links)[1]
        return self._binding.call("pi_adjoint", links, frame, slopes)[0].reshape(np.shape(lam))

    def lam_from_pi(self, pi: ArrayLike) -> Array:
        """λ of every link from π, with a ≥ b ≥ c. Source: Eqs. 4.18–4.23.

        Raises:
            NotRealisableError: a link is not physically consistent; `nearest_realisable` repairs
                it.
        """
        flat = self._links("pi", pi)
        lam = self._binding.call("lam_from_pi", flat)[0]
        bad = np.flatnonzero(~np.isfinite(lam).all(axis=1))
        if bad.size:
            links = ", ".join(dict.fromkeys(self.link_names[k % self.n_links] for k in bad))
            worst = self.relative_eigenvalues(flat[bad[0]])[0]
            raise NotRealisableError(
                f"pi of {links} is not physically consistent (smallest eigenvalue of "
                f"the pseudo-inertia {worst:.2e} of its trace); take nearest_realisable(pi) to "
                "continue with the nearest consistent parameters"
            )
        return lam.reshape(np.shape(pi))

    def nearest_realisable(self, pi: ArrayLike, floor: float = 1e-4) -> Array:
        """Nearest physically consistent π: each Σ_com becomes the nearest matrix with eigenvalues ≥
        floor · tr, while m and c stay.

        Args:
            pi: (10 L,) or (N, 10 L) inertial parameters of the links.
            floor: smallest eigenvalue of Σ_com over its trace.

        Returns:
            π of the same shape.
        """
        flat = self._links("pi", pi)
        return self._binding.call("nearest_realisable", flat, floor)[0].reshape(np.shape(pi))

    def inertia_matrix(self, lam: ArrayLike) -> Array:
        """M_k(λ_k), (L, 6, 6), linear part first. Source: Eq. 4.14."""
        blocks = self._binding.call("inertia_matrix", self._links("lam", lam))[0]
        return blocks.reshape(*np.shape(lam)[:-1], self.n_links, 6, 6)

    def pseudo_inertia(self, pi: ArrayLike) -> Array:
        """P_k(π_k), (L, 4, 4). Source: Eqs. 3.9, 3.10."""
        blocks = self._binding.call("pseudo_inertia", self._links("pi", pi))[0]
        return blocks.reshape(*np.shape(pi)[:-1], self.n_links, 4, 4)

    def relative_eigenvalues(self, pi: ArrayLike) -> Array:
        """Smallest eigenvalue of each P_k over its trace: positive means strictly consistent.

        NaN where π is not finite.
        """
        blocks = self._binding.call("pseudo_inertia", np.reshape(pi, (-1, N_PARAMETERS)))[0]
        finite = np.isfinite(blocks).all(axis=(1, 2))
        smallest = np.full(len(blocks), np.nan)
        smallest[finite] = np.linalg.eigvalsh(blocks[finite])[:, 0]
        traces = np.trace(blocks, axis1=1, axis2=2)
        return smallest / np.where(traces == 0, 1.0, np.abs(traces))

    def _links(self, name: str, value: ArrayLike) -> Array:
        """(10 L,) or (N, 10 L) as rows of one link each."""
        array = np.asarray(value, dtype=float)
        if array.ndim not in {1, 2} or array.shape[-1] != N_PARAMETERS * self.n_links:
            width = N_PARAMETERS * self.n_links
            raise ShapeError(
                f"{name} needs the shape ({width},) or (N, {width}), got {array.shape}"
            )
        return array.reshape(-1, N_PARAMETERS)
