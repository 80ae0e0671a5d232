"""Round shapes, cut from a filling: equal volumes that sum to the exact one."""

from collections.abc import Callable, Sequence

import numpy as np

from .filling import Filling, Lattice
from .relaxation import Relaxation
from .solid import Solid

Depth = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def disc(
    centre: Sequence[float],
    radius: float,
    spacing: float,
    *,
    filling: Filling = Lattice(),
    relaxation: Relaxation | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Particles in a disc, 2-D.

    Args:
        centre: [m], (2,).
        radius: [m].
        spacing: wanted spacing [m], the root of a particle's area; at most the radius.
        filling: Lattice(), BodyCentred() or Staggered(), cut to the shape.
        relaxation: Relaxation() to make them even and fit the rim; None leaves the cut filling.

    Returns:
        Positions [m], (n, 2), and volumes [m²], (n,), all equal, with the exact sum.

    Raises:
        ValueError: wrong shapes, lengths that are not positive, a spacing too coarse.
    """
    return _round("disc", point("disc", centre, 2), 0.0, radius, spacing, filling, relaxation)


def ring(
    centre: Sequence[float],
    inner: float,
    outer: float,
    spacing: float,
    *,
    filling: Filling = Lattice(),
    relaxation: Relaxation | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Particles between two circles, 2-D.

    Args:
        centre: [m], (2,).
        inner: inner radius [m].
        outer: outer radius [m].
        spacing: wanted spacing [m]; at most half the thickness.
        filling: as in ``disc``.
        relaxation: as in ``disc``.

    Returns:
        Positions [m], (n, 2), and volumes [m²], (n,), all equal, with the exact sum.

    Raises:
        ValueError: as ``disc``, or inner not below outer.
    """
    hollow("ring", inner, outer)
    return _round("ring", point("ring", centre, 2), inner, outer, spacing, filling, relaxation)


def sphere(
    centre: Sequence[float],
    radius: float,
    spacing: float,
    *,
    filling: Filling = Lattice(),
    relaxation: Relaxation | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Particles in a ball, 3-D.

    Args:
        centre: [m], (3,).
        radius: [m].
        spacing: wanted spacing [m], the cube root of a particle's volume; at most the radius.
        filling: as in ``disc``.
        relaxation: as in ``disc``.

    Returns:
        Positions [m], (n, 3), and volumes [m³], (n,), all equal, with the exact sum.

    Raises:
        ValueError: as ``disc``.
    """
    return _round("sphere", point("sphere", centre, 3), 0.0, radius, spacing, filling, relaxation)


def cylinder(
    start: Sequence[float],
    end: Sequence[float],
    radius: float,
    spacing: float,
    *,
    filling: Filling = Lattice(),
    relaxation: Relaxation | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Particles in a cylinder along any axis, 3-D; whole cells along the axis, so that both ends are flat.

    Args:
        start: centre of one end [m], (3,).
        end: centre of the other [m], (3,).
        radius: [m].
        spacing: wanted spacing [m], the cube root of a particle's volume; at most the radius and half the length.
        filling: as in ``disc``.
        relaxation: as in ``disc``.

    Returns:
        Positions [m], (n, 3), and volumes [m³], (n,), all equal, with the exact sum.

    Raises:
        ValueError: as ``disc``, or ends that coincide.
    """
    return _along("cylinder", start, end, 0.0, radius, spacing, filling, relaxation)


def tube(
    start: Sequence[float],
    end: Sequence[float],
    inner: float,
    outer: float,
    spacing: float,
    *,
    filling: Filling = Lattice(),
    relaxation: Relaxation | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Particles between two coaxial cylinders along any axis, 3-D; whole cells along the axis.

    Args:
        start: centre of one end [m], (3,).
        end: centre of the other [m], (3,).
        inner: inner radius [m].
        outer: outer radius [m].
        spacing: wanted spacing [m]; at most half the thickness and half the length.
        filling: as in ``disc``.
        relaxation: as in ``disc``.

    Returns:
        Positions [m], (n, 3), and volumes [m³], (n,), all equal, with the exact sum.

    Raises:
        ValueError: as ``cylinder``, or inner not below outer.
    """
    hollow("tube", inner, outer)
    return _along("tube", start, end, inner, outer, spacing, filling, relaxation)


def point(who: str, given: Sequence[float], dim: int) -> np.ndarray:
    """``given`` as an array (dim,); ValueError, which names ``who``, where it is not that."""
    found = np.asarray(given, dtype=float)
    if found.shape != (dim,) or not np.isfinite(found).all():
        raise ValueError(f"{who}: points must be {dim} finite numbers [m], got {given}")
    return found


def _positive(who: str, name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise ValueError(f"{who}: {name} must be positive and finite, got {value} m")


def hollow(who: str, inner: float, outer: float) -> None:
    """ValueError, which names ``who``, unless 0 < inner < outer, both finite."""
    _positive(who, "inner", inner)
    _positive(who, "outer", outer)
    if not inner < outer:
        raise ValueError(f"{who}: inner must be below outer, got {inner} and {outer} m")


def _resolved(who: str, across: float, spacing: float) -> None:
    _positive(who, "spacing", spacing)
    if not across >= 2.0 * spacing * (1.0 - 1e-9):
        raise ValueError(
            f"{who}: a spacing of {spacing:.6g} m is too coarse, the thinnest part is {across:.6g} m; "
            "use at least two spacings across it"
        )


def _radial(offset: np.ndarray, inner: float, outer: float) -> tuple[np.ndarray, np.ndarray]:
    """Depth and inward unit vectors of points ``offset`` from the centre, between two radii (0: no inner one)."""
    r = np.linalg.norm(offset, axis=1)
    outward = np.divide(offset, r[:, None], out=np.zeros_like(offset), where=r[:, None] > 0.0)
    if inner == 0.0:
        return outer - r, -outward
    near_inner = r - inner < outer - r
    return np.minimum(outer - r, r - inner), np.where(near_inner[:, None], outward, -outward)


def _round(
    who: str,
    centre: np.ndarray,
    inner: float,
    outer: float,
    spacing: float,
    filling: Filling,
    relaxation: Relaxation | None,
) -> tuple[np.ndarray, np.ndarray]:
    if not inner:
        _positive(who, "radius", outer)
    _resolved(who, outer - inner if inner else 2.0 * outer, spacing)
    volume = np.pi * (outer**2 - inner**2) if len(centre) == 2 else 4.0 / 3.0 * np.pi * outer**3
    # Filled about the origin, so that what is symmetric stays so to the last bit.
    reach = np.full(len(centre), outer)
    solid = Solid(-reach, reach, volume, lambda x: _radial(x, inner, outer))
    x, volumes = solid.fill(spacing, filling, relaxation, who)
    return x + centre, volumes


def _along(
    who: str,
    start: Sequence[float],
    end: Sequence[float],
    inner: float,
    outer: float,
    spacing: float,
    filling: Filling,
    relaxation: Relaxation | None,
) -> tuple[np.ndarray, np.ndarray]:
    first, last = point(who, start, 3), point(who, end, 3)
    length = float(np.linalg.norm(last - first))
    if not inner:
        _positive(who, "radius", outer)
    _positive(who, "distance from start to end", length)
    _resolved(who, min(length, outer - inner if inner else 2.0 * outer), spacing)

    def depth(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        below, inward = _radial(x[:, :2], inner, outer)
        to_end = 0.5 * length - np.abs(x[:, 2])
        at_end = (to_end < below)[:, None]
        along = np.stack([np.zeros(len(x)), np.zeros(len(x)), -np.sign(x[:, 2])], axis=1)
        return np.minimum(below, to_end), np.where(at_end, along, np.pad(inward, ((0, 0), (0, 1))))

    reach = np.array([outer, outer, 0.5 * length])
    solid = Solid(-reach, reach, np.pi * (outer**2 - inner**2) * length, depth)
    x, volumes = solid.fill(spacing, filling, relaxation, who)
    return x @ _frame((last - first) / length) + 0.5 * (first + last), volumes


def _frame(axis: np.ndarray) -> np.ndarray:
    """Rotation whose rows are two unit vectors across ``axis`` and the axis itself; along z the identity."""
    first = np.roll(np.eye(3)[np.abs(axis).argmax()], 1)
    across = first - axis * (axis @ first)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(axis, across), axis])
