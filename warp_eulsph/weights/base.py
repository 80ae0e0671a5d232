"""What an SPH weight (smoothing function W) declares."""

import functools
from abc import ABC, abstractmethod
from typing import ClassVar

import warp as wp

from ..space import Space


class Weight(ABC):
    """Radial weight W(r, h) = σ_d / h^d · w(q), q = r/h, zero from q = ``support`` on.

    A new weight is one file: ``support``, ``sigma`` for 1-D, 2-D, 3-D, ``profile``, and ``slope_cpp`` for speed.
    """

    support: ClassVar[float]
    sigma: ClassVar[tuple[float, float, float]]
    #: −w'(q)/q once more, in C++ for SIMD kernels: an expression of the vector q, of type V with components of type T.
    #: None leaves that pass to the portable kernel.
    slope_cpp: ClassVar[str | None] = None

    @abstractmethod
    def profile(self, real: type) -> tuple[wp.Function, wp.Function]:
        """The two ``wp.func`` of q in [0, support): w(q), and −w'(q)/q, which is finite at q = 0."""

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other)

    def __hash__(self) -> int:
        return hash(type(self))

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"


@functools.cache
def value(weight: Weight, space: Space) -> wp.Function:
    """``wp.func`` W(r, h) [1/m^d]."""
    real, dim = space.real, space.dim
    support, sigma = weight.support, weight.sigma[dim - 1]
    profile, _ = weight.profile(real)

    @wp.func
    def value(r: real, h: real) -> real:
        q = r / h
        W = real(0.0)
        if q < real(support):
            W = real(sigma) * profile(q)
            for _ in range(wp.static(dim)):
                W = W / h
        return W

    return value


@functools.cache
def pair_weight(weight: Weight, space: Space) -> wp.Function:
    """``wp.func`` g(r, h) = −W'(r)/r [1/m^(d+2)], so that ∇W_ab = g (x_b − x_a)."""
    real, dim = space.real, space.dim
    support, sigma = weight.support, weight.sigma[dim - 1]
    _, slope = weight.profile(real)

    @wp.func
    def pair_weight(r: real, h: real) -> real:
        rate = real(1.0) / h
        q = r * rate
        g = real(0.0)
        if q < real(support):
            g = real(sigma) * slope(q)
            for _ in range(wp.static(dim + 2)):
                g = g * rate
        return g

    return pair_weight
