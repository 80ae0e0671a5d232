"""What a simulation shows of itself besides its state: fields made from it, and a short table."""

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from .structs import ParticleArrays
from .summary import Rows, as_html, as_text, extent
from .turns import in_turn

if TYPE_CHECKING:
    from .body import Body
    from .boundaries import Boundary
    from .interactions import Interaction
    from .order import Order
    from .scheme.stepper import Stepper
    from .space import Space

#: Forces of ``fields.FORCES`` that move a particle, those of the conditions among them.
ALL_FORCES = ("internal", "correction", "tie", "dissipation", "external", "reaction")


@in_turn()
class Looks:
    """Fields of a ``Simulation`` in the order of the bodies' particles, copies on the host, and how it is shown."""

    bodies: "list[Body]"
    boundaries: "tuple[Boundary, ...]"
    interactions: "tuple[Interaction, ...]"
    space: "Space"
    order: "Order"
    device: wp.Device
    stepper: "Stepper"
    particles: ParticleArrays

    if TYPE_CHECKING:

        @property
        def t(self) -> float: ...

        @property
        def dt(self) -> float: ...

        @property
        def steps(self) -> int: ...

        @property
        def x(self) -> np.ndarray: ...

        @property
        def F(self) -> np.ndarray: ...

        def extrema(self) -> dict[str, float]: ...

        def energy(self) -> dict[str, float]: ...

    @property
    def X(self) -> np.ndarray:
        """Initial positions [m], (n, dim)."""
        return np.concatenate([body.x for body in self.bodies])

    @property
    def displacement(self) -> np.ndarray:
        """Displacements x − X since the start [m], (n, dim)."""
        return self.x - self.X

    @property
    def cauchy_stress(self) -> np.ndarray:
        """Cauchy stresses σ [Pa], (n, 3, 3) in any dimension: σ33 of plane strain counts; of a bar σ11 only."""
        from .output.stress import cauchy_stress

        simulation: Any = self
        return cauchy_stress(simulation)

    @property
    def first_piola(self) -> np.ndarray:
        """First Piola–Kirchhoff stresses P = J σ F⁻ᵀ, force per initial area [Pa], (n, 3, 3); missing stretches are 1.

        F is the one the material carries: of a liquid its volume only.
        """
        from .output.tensors import first_piola

        return first_piola(self.cauchy_stress, self.F)

    @property
    def strain_energy_density(self) -> np.ndarray:
        """Stored energy per initial volume Ψ [J/m³], (n,)."""
        return self.order.by_number(self.stepper.ledger.stored_by_particle(self.stepper.U) / self.particles.V0.numpy())

    def history(self, name: str) -> np.ndarray:
        """What materials remember under this name, (n,), or (n, 3, 3) of a tensor; NaN in bodies whose law does not.

        Raises:
            ValueError: no material remembers anything of that name.
        """
        bodies = self.stepper.remembering
        found = [part.law.by_name(part.history.numpy()).get(name) for _, part in bodies]
        shapes = [values.shape[1:] for values in found if values is not None]
        if not shapes:
            known = sorted({variable.name for _, part in bodies for variable in part.law.history})
            what = f"must be one of {known}, which the" if known else "has no names, for these"
            raise ValueError(f"history {what} materials remember{'' if known else ' nothing'}, got {name!r}")
        out = np.full((len(self.particles.mass), *shapes[0]), np.nan, dtype=self.space.numpy)
        for (span, _), values in zip(bodies, found, strict=True):
            if values is not None:
                out[span.start : span.stop] = values
        return self.order.by_number(out)

    @property
    def force(self) -> np.ndarray:
        """Forces on the particles in the last step, all together [N], (n, dim): N/m in 2-D, N/m² in 1-D.

        From the material, from dissipation, loads and conditions. Zero before the first step.
        """
        parts = [getattr(self.stepper.forces, name) for name in ALL_FORCES]
        return self.order.by_number(sum(part.numpy() for part in parts if len(part)))

    @property
    def interaction_force(self) -> np.ndarray:
        """Forces of the interactions on the particles in the last step [N], (n, dim): of contact, for example.

        Summed over ``simulation.ranges[name]`` it is what a body takes from others. Zero before the first step, and
        without interactions.
        """
        exchanged = [forces.numpy() for forces in self.stepper.exchanged]
        return self.order.by_number(sum(exchanged) if exchanged else np.zeros_like(self.stepper.U.x.numpy()))

    @property
    def acceleration(self) -> np.ndarray:
        """Accelerations, ``force`` over mass [m/s²], (n, dim)."""
        return self.force / self.order.by_number(self.particles.mass.numpy())[:, None]

    def _summary(self) -> tuple[str, Rows]:
        dim, particles = self.space.dim, f"{len(self.X)} particles"
        names = ", ".join(f"{body.name!r} ({len(body.x)} of {type(body.material).__name__})" for body in self.bodies)
        conditions = ", ".join(type(boundary).__name__ for boundary in self.boundaries) or "none"
        extrema, energy = self.extrema(), self.energy()
        return f"Simulation: {particles}, {dim}-D, {self.space.real.__name__} on {self.device}", [
            ("bodies", names),
            ("conditions", conditions),
            ("interactions", ", ".join(type(each).__name__ for each in self.interactions) or "none"),
            ("time", f"{self.t:.6g} s, step {self.steps}, last one {self.dt:.4g} s"),
            ("extent", extent(self.x)),
            ("volume ratio", f"{extrema['least J']:.4g} … {extrema['largest J']:.4g}"),
            ("largest speed", f"{extrema['speed']:.4g} m/s"),
            ("energy", f"{energy['kinetic']:.4g} J kinetic + {energy['stored']:.4g} J stored"),
        ]

    def __repr__(self) -> str:
        return as_text(*self._summary())

    def _repr_html_(self) -> str:
        return as_html(*self._summary())
