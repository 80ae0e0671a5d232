"""Fillings: how particles repeat in space, one unit cell each, laid out about the centre of the box."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


class Cell(NamedTuple):
    """The cell that a filling repeats.

    Attributes:
        places: of its particles, in shares of the cell's lengths, (k, dim).
        lengths: of the cell over the spacing, (dim,); their product is k, so that every particle takes spacing^dim.
    """

    places: np.ndarray
    lengths: np.ndarray


@dataclass(frozen=True)
class Filling(ABC):
    """How particles repeat; all fillings have the same number of particles at the same spacing = volume^(1/dim)."""

    @abstractmethod
    def cell(self, dim: int) -> Cell:
        """The cell in this dimension; in 1-D there is but one filling."""


@dataclass(frozen=True)
class Lattice(Filling):
    """Square or cubic lattice, one particle at the centre of each cell."""

    def cell(self, dim: int) -> Cell:
        return Cell(np.full((1, dim), 0.5), np.ones(dim))


@dataclass(frozen=True)
class BodyCentred(Filling):
    """Body-centred cubic lattice, in 2-D the centred square one: two particles on the diagonal of each cell."""

    def cell(self, dim: int) -> Cell:
        if dim == 1:
            return Lattice().cell(1)
        return Cell(np.array([[0.25] * dim, [0.75] * dim]), np.full(dim, 2.0 ** (1.0 / dim)))


@dataclass(frozen=True)
class Staggered(Filling):
    """Close packing, rows along x shifted by half: triangles in 2-D, hexagonal layers over each other in 3-D."""

    def cell(self, dim: int) -> Cell:
        if dim == 1:
            return Lattice().cell(1)
        if dim == 2:
            lengths = np.array([1.0, np.sqrt(3.0)])
            places = np.array([[0.25, 0.25], [0.75, 0.75]])
        else:
            lengths = np.array([1.0, np.sqrt(3.0), np.sqrt(8.0 / 3.0)])
            # Two layers of two rows; the second layer's rows lie over the gaps of the first.
            places = np.array([[3, 2, 3], [9, 8, 3], [9, 4, 9], [3, 10, 9]]) / 12.0
        return Cell(places, lengths * (len(places) / lengths.prod()) ** (1.0 / dim))
