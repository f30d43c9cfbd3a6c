"""Dynamics of one robot on arrays of torch or JAX: the functions, their arguments and shapes."""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from runtime.errors import ShapeError
from runtime.library import Library, require_library
from runtime.tapes.derivatives import Tensor


class TapeFunctions(ABC):
    """τ, M, h, g, ddq and the loss of a robot as differentiable functions.

    Arrays have the shape (..., size); leading axes are samples and broadcast. Those of a free base
    begin with its coordinates: see `runtime.BaseMotion`. π is that of the URDF where neither `pi`
    nor `lam` is given. Single precision is computed in double.
    """

    def __init__(self, lib: Library) -> None:
        require_library(lib)
        self.lib = lib
        self._size = {"pi": lib.pi0.size, "lam": lib.pi0.size}
        self._constants: dict[Any, Tensor] = {}

    @abstractmethod
    def _array(self, name: str, value: Any, like: Tensor | None = None) -> Tensor:
        """The value as an array, of the dtype of another if given."""

    @abstractmethod
    def _call(self, kernel: str, *values: Tensor) -> Tensor:
        """First output of a kernel, on the tape."""

    def inverse_dynamics(
        self, q: Any, dq: Any, ddq: Any, pi: Any = None, *, lam: Any = None
    ) -> Tensor:
        """Joint torques τ = Y(q, dq, ddq) π. Source: Eq. 4.3.

        Args:
            q: (..., n) joint positions [rad, m].
            dq: joint velocities [rad/s, m/s].
            ddq: joint accelerations [rad/s², m/s²].
            pi: (..., 10 L) inertial parameters.
            lam: (..., 10 L) coordinates λ in place of π.

        Returns:
            (..., n) [N·m, N].

        Raises:
            ShapeError: an argument has another shape, or is no array of real numbers.
        """
        return self._call("inverse_dynamics", *self._motion(q=q, dq=dq, ddq=ddq, pi=pi, lam=lam))

    def mass_matrix(self, q: Any, pi: Any = None, *, lam: Any = None) -> Tensor:
        """Mass matrix M(q). Source: Eq. 2.34.

        Args:
            q: (..., n) joint positions [rad, m].
            pi: (..., 10 L) inertial parameters.
            lam: (..., 10 L) coordinates λ in place of π.

        Returns:
            (..., n, n).

        Raises:
            ShapeError: an argument has another shape, or is no array of real numbers.
        """
        return self._call("mass_matrix", *self._motion(q=q, pi=pi, lam=lam))

    def bias(self, q: Any, dq: Any, pi: Any = None, *, lam: Any = None) -> Tensor:
        """Bias forces h = τ(q, dq, 0): Coriolis, centrifugal and gravity. Source: Eq. 2.34.

        Args:
            q: (..., n) joint positions [rad, m].
            dq: joint velocities [rad/s, m/s].
            pi: (..., 10 L) inertial parameters.
            lam: (..., 10 L) coordinates λ in place of π.

        Returns:
            (..., n) [N·m, N].

        Raises:
            ShapeError: an argument has another shape, or is no array of real numbers.
        """
        return self._call("bias_forces", *self._motion(q=q, dq=dq, pi=pi, lam=lam))

    def gravity(self, q: Any, pi: Any = None, *, lam: Any = None) -> Tensor:
        """Torques that hold the robot at rest, g = τ(q, 0, 0).

        Args:
            q: (..., n) joint positions [rad, m].
            pi: (..., 10 L) inertial parameters.
            lam: (..., 10 L) coordinates λ in place of π.

        Returns:
            (..., n) [N·m, N].

        Raises:
            ShapeError: an argument has another shape, or is no array of real numbers.
        """
        q, pi = self._motion(q=q, pi=pi, lam=lam)
        return self._call("bias_forces", q, self._zeros(q), pi)

    def forward_dynamics(
        self, q: Any, dq: Any, tau: Any, pi: Any = None, rotor: Any = None, *, lam: Any = None
    ) -> Tensor:
        """Accelerations ddq = (M + diag(J))⁻¹ (τ − h).

        Args:
            q: (..., n) joint positions [rad, m].
            dq: joint velocities [rad/s, m/s].
            tau: joint torques [N·m, N].
            pi: (..., 10 L) inertial parameters.
            rotor: J (..., n), inertia of the rotors [kg·m², kg]; None: zero.
            lam: (..., 10 L) coordinates λ in place of π.

        Returns:
            (..., n) [rad/s², m/s²].

        Raises:
            ShapeError: an argument has another shape, or is no array of real numbers.
        """
        q, dq, tau, pi = self._motion(q=q, dq=dq, tau=tau, pi=pi, lam=lam)
        inertia = self._zeros(q) if rotor is None else self._entry("rotor", rotor, q)
        return self._call("forward_dynamics", q, dq, tau, pi, inertia)

    def regressor_loss(
        self,
        q: Any,
        dq: Any,
        ddq: Any,
        tau: Any,
        pi: Any = None,
        weight: Any = None,
        *,
        lam: Any = None,
    ) -> Tensor:
        """Loss L = Σ ½ rᵀ W r over all samples, r = Y π − τ. Source: Eqs. 4.5, 4.6.

        Args:
            q: (..., n) joint positions [rad, m].
            dq: joint velocities [rad/s, m/s].
            ddq: joint accelerations [rad/s², m/s²].
            tau: (..., n) measured torques [N·m, N].
            pi: (10 L,) inertial parameters, the same for all samples.
            weight: (n,) diagonal of W; None: 1.
            lam: (10 L,) coordinates λ in place of π.

        Returns:
            () loss.

        Raises:
            ShapeError: an argument has another shape, or is no array of real numbers.
        """
        *state, pi = self._motion(q=q, dq=dq, ddq=ddq, tau=tau, pi=pi, lam=lam)
        diagonal = self._zeros(pi[..., : self.lib.n_rows]) + 1
        if weight is not None:
            diagonal = self._entry("weight", weight, pi)
        for name, value in (("pi", pi), ("weight", diagonal)):
            if value.ndim != 1:
                raise ShapeError(
                    f"regressor_loss needs one {name} for all samples, got {tuple(value.shape)}; "
                    "use vmap for several"
                )
        beta = pi @ self._constant("base_matrix", pi)
        lead = np.broadcast_shapes(*(tuple(x.shape[:-1]) for x in state))
        rows = [self._rows(x, lead) for x in state]
        return self._call("loss_gradient", *rows, diagonal, beta)[0]

    def pi_from_lam(self, lam: Any) -> Tensor:
        """Inertial parameters π of coordinates λ. Source: Eqs. 4.25 to 4.31.

        Args:
            lam: (..., 10 L) coordinates of all links.

        Returns:
            (..., 10 L).

        Raises:
            ShapeError: the argument has another shape, or is no array of real numbers.
        """
        value = self._entry("lam", lam)
        links = self._call("pi_from_lam", value.reshape(*value.shape[:-1], self.lib.n_links, -1))
        return links.reshape(value.shape)

    def _motion(self, *, pi: Any, lam: Any, **state: Any) -> list[Tensor]:
        """State and π as arrays of one dtype, their shapes checked."""
        if pi is not None and lam is not None:
            raise ShapeError("expected pi or lam, got both; leave one of them out")
        arrays: list[Tensor] = []
        for name, value in state.items():
            arrays.append(self._entry(name, value, arrays[0] if arrays else None))
        if lam is not None:
            return [*arrays, self.pi_from_lam(self._entry("lam", lam, arrays[0]))]
        if pi is None:
            return [*arrays, self._constant("pi0", arrays[0])]
        return [*arrays, self._entry("pi", pi, arrays[0])]

    def _entry(self, name: str, value: Any, like: Tensor | None = None) -> Tensor:
        size = self._size.get(name, self.lib.n_rows)
        array = self._array(name, value, like)
        if not array.ndim or array.shape[-1] != size:
            raise ShapeError(
                f"{name} of '{self.lib.name}' needs the shape (..., {size}), "
                f"got {tuple(array.shape)}"
            )
        return array

    def _constant(self, name: str, like: Tensor) -> Tensor:
        """π of the URDF or a matrix of the base parameters, kept per dtype."""
        key = (name, like.dtype)
        if key not in self._constants:
            value = self.lib.pi0 if name == "pi0" else self.lib.base_matrix.T
            self._constants[key] = self._array(name, value, like)
        return self._constants[key]

    @staticmethod
    @abstractmethod
    def _zeros(like: Tensor) -> Tensor:
        """Zeros of one sample, (size,), of the dtype of another array."""

    @staticmethod
    @abstractmethod
    def _rows(value: Tensor, lead: tuple[int, ...]) -> Tensor:
        """One row per sample: (N, size) of the leading axes."""
