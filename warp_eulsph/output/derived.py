"""Fields that a frame derives from those it holds."""

from typing import TYPE_CHECKING

import numpy as np

from .tensors import first_piola

#: Units of the fields that a frame derives from those it holds.
DERIVED = {
    "von_mises": "Pa",
    "principal_stresses": "Pa",
    "principal_stretches": "-",
    "green_lagrange": "-",
    "first_piola": "Pa",
}


class Derived:
    """Stresses and strains of a frame with ``cauchy_stress`` and ``F``."""

    if TYPE_CHECKING:

        @property
        def F(self) -> np.ndarray: ...

        @property
        def cauchy_stress(self) -> np.ndarray: ...

    @property
    def von_mises(self) -> np.ndarray:
        """Von Mises stress √(3/2 s:s) of the stress deviator s [Pa], (N,)."""
        sigma = self.cauchy_stress.astype(float)
        deviator = sigma - np.trace(sigma.T)[:, None, None] / 3.0 * np.eye(3)
        return np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))

    @property
    def principal_stresses(self) -> np.ndarray:
        """Eigenvalues of the Cauchy stress [Pa], (N, 3), least first."""
        return np.linalg.eigvalsh(self.cauchy_stress.astype(float))

    @property
    def principal_stretches(self) -> np.ndarray:
        """Singular values of F [-], (N, dim), least first."""
        F: np.ndarray = self.F.astype(float)
        return np.linalg.svd(F, compute_uv=False)[:, ::-1]

    @property
    def green_lagrange(self) -> np.ndarray:
        """Green-Lagrange strain ½ (FᵀF − I) [-], (N, dim, dim)."""
        F = self.F.astype(float)
        return 0.5 * (F.transpose(0, 2, 1) @ F - np.eye(F.shape[1]))

    @property
    def first_piola(self) -> np.ndarray:
        """First Piola–Kirchhoff stresses J σ F⁻ᵀ, force per initial area [Pa], (N, 3, 3); missing stretches are 1."""
        return first_piola(self.cauchy_stress.astype(float), self.F.astype(float))
