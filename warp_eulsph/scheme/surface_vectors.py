"""Surface vectors: the defect of the dual divergence taken back particle by particle (M10)."""

import functools
from dataclasses import dataclass

import warp as wp

from ..execution import Launcher
from ..space import Space
from ..structs import ParticleArrays, StateArrays
from .dissipation import UpwindForces
from .flux import Flux
from .projection import Projection
from .reference import Configuration
from .stabiliser import Correction, Stabiliser, Sums


@dataclass(frozen=True)
class SurfaceVectors(Correction):
    """Force correction Q_a (e_a − s_a) (M10): the cheap choice, momentum not exact by itself.

    Args:
        project: take the net force and torque of the correction off each body by the mass-weighted least change. For
            free bodies; a supported body must not be projected, its supports carry the difference.
    """

    project: bool = False
    per_body = True

    def build(self, space: Space, particles: ParticleArrays, flux: Flux, device: wp.DeviceLike) -> "SurfaceForces":
        """Allocate for the bodies of ``flux``, each a range of particles."""
        return SurfaceForces(self, space, particles, flux.bodies, device)


@functools.cache
def _make_correction(space: Space) -> wp.Kernel:
    """Kernel: the correction force Q_a (e_a − s_a)."""
    vec, mat = space.vec, space.mat

    @wp.kernel(module="unique", enable_backward=False)
    def correction(first: int, Q: wp.array(dtype=mat), defect: wp.array(dtype=vec), out: wp.array(dtype=vec)):
        a = first + wp.tid()
        out[a] = Q[a] @ defect[a]

    return correction


class SurfaceForces(Stabiliser):
    """M9 and M10 at work."""

    def __init__(
        self,
        option: SurfaceVectors,
        space: Space,
        particles: ParticleArrays,
        bodies: list[range],
        device: wp.DeviceLike,
    ):
        self.space, self.device = space, device
        self.upwind, self._launch = UpwindForces(space, device), Launcher(device)
        self.defect = wp.zeros(len(particles.mass), dtype=space.vec, device=device)
        self.projection = Projection(space, particles, bodies, device) if option.project else None

    def refresh(self, configuration: Configuration, state: StateArrays) -> None:
        """The defect e_a − s_a of the new reference."""
        configuration.defect(state.surface, self.defect)

    def takes_dual(self, configuration: Configuration, sensed: bool) -> bool:
        """As the forces that are corrected do."""
        return self.upwind.takes_dual(configuration, sensed)

    def evolving(self) -> dict[str, wp.array]:
        """The defect: of the surface vectors at the last refresh, which are not kept."""
        return {"SurfaceForces.defect": self.defect}

    def compute(self, sums: Sums, x: wp.array, v: wp.array) -> None:
        """Internal force (M5), dissipation (M9) and correction (M10)."""
        self.upwind.compute(sums, x, v)
        arguments = [sums.flux.Q, self.defect, sums.forces.correction]
        self._launch(_make_correction(self.space), len(v), arguments)
        if self.projection is not None:
            self.projection(sums.configuration.fields.x, sums.forces.correction)
