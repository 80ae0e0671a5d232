"""Shapes of case files: the functions of ``geometry``."""

from typing import Any

from .. import geometry
from .options import Options

SHAPES = tuple(getattr(geometry, name) for name in geometry.__all__ if not isinstance(getattr(geometry, name), type))


def dimension(shape: Options) -> int:
    """Dimension of a shape, by its first point; outlines are in 2-D, meshes in 3-D."""
    points = [value for _, value in shape if isinstance(value, list)]
    if points:
        return len(points[0])
    return 2 if shape.target is geometry.outline else 3


def particles(shape: Options, path: str) -> tuple[Any, ...]:
    """What the function gives: positions, volumes, maybe surfaces.

    Raises:
        ValueError: a shape that cannot be filled, or not in this memory; it names the ``path`` in the file.
    """
    try:
        return shape.make()
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    except MemoryError:
        raise ValueError(f"{path}: it does not fit into memory; increase the spacing") from None
