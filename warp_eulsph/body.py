"""A solid as particles: what a simulation is built from."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .checks import instance, positive, real_array, spread
from .materials import Material
from .scheme.arrangement import Arrangement
from .scheme.base import Scheme
from .scheme.policy import ReferencePolicy
from .summary import Rows, as_html, as_text, extent, least_to_largest, mass_unit
from .weights import Weight

#: Options that a body may have of its own, beside the dilation.
_OWN: tuple[tuple[str, type, str], ...] = (
    ("reference", ReferencePolicy, "Never()"),
    ("arrangement", Arrangement, "Convected()"),
    ("scheme", Scheme, "Verlet()"),
    ("weight", Weight, "CubicSpline()"),
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Body:
    """A solid as particles.

    Args:
        x: initial positions [m], (n, dim).
        volume: initial volumes [m^dim], a number or (n,).
        material: its law.
        spacing: initial particle spacing [m], a number or (n,); by default volume^(1/dim).
        velocity: initial velocities [m/s], a number, (dim,) or (n, dim).
        surface: outward area vectors s_a [m^(dim−1)], (n, dim), or 0 for a periodic body without a surface; by default
            the defect e_a of the initial arrangement, which on a disordered one is noise inside too. Given vectors make
            M10, M11 and M12 work with a fixed reference as well; without them they are zero there.
        name: for boundary conditions and output.
        reference, arrangement, scheme, weight, dilation: as in ``Simulation``, whose these are where they are None.
            Bodies that follow each other and agree in all of them are one medium.
        bonded: name of a body before it that it is bonded to: particles of both that are near each other are
            neighbours, as in one solid of two materials. Both are of one medium, and by default take what suits both
            (that of metal where one of them yields). The outermost particles of each are
            still its own, so that loads on faces go to regions away from the joint.

    Raises:
        ValueError: wrong shapes, entries that are not finite real numbers, volumes or spacings that are not positive.

    Arrays are kept as copies that are read-only; ``dataclasses.replace`` makes a body with others.
    """

    x: np.ndarray
    volume: Any
    material: Material
    spacing: Any = None
    velocity: Any = 0.0
    surface: Any = None
    name: str = "body"
    reference: ReferencePolicy | None = None
    arrangement: Arrangement | None = None
    scheme: Scheme | None = None
    weight: Weight | None = None
    dilation: float | None = None
    bonded: str | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ValueError(f"name of a body must be text, got {self.name!r}")
        if not isinstance(self.material, Material):
            given = f"the class {self.material.__name__}" if isinstance(self.material, type) else repr(self.material)
            raise ValueError(
                f"body {self.name!r}: material must be a law such as NeoHookean(density=1100.0, young=17e6, "
                f"poisson=0.45), got {given}"
            )
        x = real_array(self.x, f"body {self.name!r}: x", finite=False)
        if x.ndim == 1 and x.size:
            raise ValueError(f"body {self.name!r}: x must have shape (n, dim), got {x.shape}; in 1-D give x[:, None]")
        if x.ndim != 2 or x.shape[0] == 0 or x.shape[1] not in (1, 2, 3):
            raise ValueError(f"body {self.name!r}: x must have shape (n, 1), (n, 2) or (n, 3), got {x.shape}")
        self._keep("x", self._field("x", x, x.shape))
        self._keep("volume", self._field("volume", self.volume, (len(x),), positive=True))
        spacing = self.volume ** (1.0 / x.shape[1]) if self.spacing is None else self.spacing
        self._keep("spacing", self._field("spacing", spacing, (len(x),), positive=True))
        self._keep("velocity", self._field("velocity", self.velocity, x.shape))
        if self.surface is not None:
            self._keep("surface", self._field("surface", self.surface, x.shape))
        for name, kind, example in _OWN:
            if getattr(self, name) is not None:
                instance(getattr(self, name), kind, f"body {self.name!r}: {name}", example)
        if self.dilation is not None:
            positive(self.dilation, f"body {self.name!r}: dilation", "1.3 is the tested value")

    def _keep(self, name: str, values: np.ndarray) -> None:
        """A copy that nobody changes by accident."""
        kept = np.array(values)
        kept.setflags(write=False)
        object.__setattr__(self, name, kept)

    def _summary(self) -> tuple[str, Rows]:
        n, dim = self.x.shape
        mass = self.material.density * self.volume.sum()
        return f"Body {self.name!r}: {n} particles, {dim}-D", [
            ("material", repr(self.material)),
            ("extent", extent(self.x)),
            ("spacing", least_to_largest(self.spacing, "m")),
            ("mass", f"{mass:.6g} {mass_unit(dim)}"),
            ("speed", least_to_largest(np.linalg.norm(self.velocity, axis=1), "m/s")),
            ("surface", "of the arrangement" if self.surface is None else "given"),
        ]

    def __repr__(self) -> str:
        return as_text(*self._summary())

    def _repr_html_(self) -> str:
        return as_html(*self._summary())

    def _field(self, name: str, given: Any, shape: tuple[int, ...], positive: bool = False) -> np.ndarray:
        who = f"body {self.name!r}: {name}"
        values = spread(real_array(given, who, finite=False), shape, who)
        wrong = ~np.isfinite(values)
        if positive:
            wrong |= values <= 0.0
        if wrong.any():
            first = np.argwhere(wrong)[0]
            raise ValueError(
                f"{who} must be {'positive and ' if positive else ''}finite, "
                f"got {values[tuple(first)]} at particle {first[0]} ({wrong.sum()} such values)"
            )
        return values


def checked_bodies(bodies: list[Body]) -> list[Body]:
    """The bodies, if one simulation can run them.

    Raises:
        ValueError: none, equal names, different dimensions, surfaces given for some only, bonds to what is not there.
    """
    if not bodies:
        raise ValueError("a simulation needs at least one body, got none")
    names = [body.name for body in bodies]
    if len(set(names)) < len(names):
        raise ValueError(f"names of bodies must differ, got {names}; pass name=...")
    given = [body.name for body in bodies if body.surface is not None]
    if given and len(given) < len(bodies):
        raise ValueError(f"surface must be given for all bodies or for none, got it for {given} of {names}")
    for k, body in enumerate(bodies):
        if body.bonded is None:
            continue
        who, before = f"body {body.name!r}", names[:k]
        if body.bonded not in before:
            raise ValueError(f"{who}: bonded must be a body before it, of {before}, got {body.bonded!r}")
        if body.material.flows != bodies[names.index(body.bonded)].material.flows:
            raise ValueError(f"{who}: a fluid must not be bonded to a solid; join them by an interaction")
    dims = {body.name: body.x.shape[1] for body in bodies}
    if len(set(dims.values())) > 1:
        raise ValueError(f"bodies must have the same dimension, got {dims}")
    return bodies


def groups_of(bodies: Sequence[Body]) -> list[int]:
    """Number of the bodies that each is bonded to, with what those are bonded to: equal for all that are connected."""
    groups: dict[str, int] = {}
    for k, body in enumerate(bodies):
        groups[body.name] = k if body.bonded is None else groups[body.bonded]
    return list(groups.values())
