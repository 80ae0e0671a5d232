"""The flux of momentum: stress in the reference, body by body (M1), and the wave speeds there."""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import warp as wp

from ..atomics import raise_to
from ..execution import Launcher
from ..fields import allocate, clock_structure, structure
from ..linalg import det, inverse, largest_shortening
from ..materials import Law, Material
from ..space import Space
from .policy import Always, Every, ReferencePolicy
from .reference import Configuration, resolution


@functools.cache
def stress_in_reference(space: Space, law: Law) -> Any:
    """``wp.func`` Q = P(F) F_kᵀ / J_k (M1); the Cauchy stress when F_k = F, P when F_k = I."""
    mat, Constants = space.mat, law.Constants
    stress, determinant = law.stress, det(space)

    @wp.func
    def stress_in_reference(F: mat, F_k: mat, c: Constants) -> mat:
        return stress(F, c) @ wp.transpose(F_k) / determinant(F_k)

    return stress_in_reference


@functools.cache
def _make_flux(space: Space, law: Law, fixed: bool, dual: bool) -> Any:
    mat = space.mat
    Reference, Flux, Constants = structure(space, "Reference"), structure(space, "Flux"), law.Constants
    P_of, Q_of = law.stress, stress_in_reference(space, law)

    @wp.kernel(module="unique", enable_backward=False)
    def compute_flux(first: int, F: wp.array(dtype=mat), reference: Reference, c: Constants, flux: Flux):
        a = first + wp.tid()
        Q = mat()
        if wp.static(fixed):
            Q = P_of(F[a], c)
        else:
            Q = Q_of(F[a], reference.F[a], c)
        flux.Q[a] = Q
        if wp.static(dual):
            flux.Pi[a] = Q @ wp.transpose(reference.L[a])

    return compute_flux


# Largest |∇v| Δt over the Courant number. Single particles can outrun the waves where an arrangement is lost, and would
# pass through their neighbours in one step: without this the punch at 50² to 90² fails now and then.
STRAIN = 0.25


@functools.cache
def _make_wave_speeds(space: Space, law: Law, fixed: bool) -> Any:
    real, mat = space.real, space.mat
    Particles, Reference, Flux = structure(space, "Particles"), structure(space, "Reference"), structure(space, "Flux")
    Clock, Constants, dim = clock_structure(space), law.Constants, float(space.dim)
    invert, moduli, shortening_of = inverse(space), law.wave_moduli, largest_shortening(space)
    raise_rate, resolution_of = raise_to(real), resolution(space)

    @wp.kernel(module="unique", enable_backward=False)
    def wave_speeds(
        first: int,
        F: wp.array(dtype=mat),
        grad_v: wp.array(dtype=mat),
        particles: Particles,
        reference: Reference,
        c: Constants,
        flux: Flux,
        clock: Clock,
    ):
        a = first + wp.tid()
        # A wave of speed c runs at c |G⁻¹| when distances are measured in the reference, G = F F_k⁻¹.
        G = F[a]
        if wp.static(not fixed):
            G = G @ invert(reference.F[a])
        shortening = shortening_of(G)  # squared
        M = moduli(F[a], c)
        per_density = shortening * particles.V0[a] / particles.mass[a]
        speed = wp.sqrt(wp.max(M[0], real(0.0)) * per_density)
        shear_speed = wp.sqrt(wp.max(M[1], real(0.0)) * per_density)
        rho_k = particles.mass[a] / reference.V[a]
        flux.speed[a] = speed
        flux.impedance[a] = rho_k * speed
        flux.shear_impedance[a] = rho_k * shear_speed
        rate = speed
        if wp.static(fixed):
            rate *= reference.resolution[a]
        else:
            rate *= resolution_of(a, particles, reference)
        # |∇v G⁻¹| ≤ |∇v| |G⁻¹| and, of the bound, |G⁻¹|² ≤ d · shortening: seldom is more than that asked for
        strain_rate = real(STRAIN) * rate
        if wp.ddot(grad_v[a], grad_v[a]) * shortening * real(dim) > strain_rate * strain_rate:
            D = grad_v[a] @ invert(G)
            rate = wp.max(rate, wp.sqrt(wp.ddot(D, D)) / real(STRAIN))
        raise_rate(clock.rate, rate)

    return wave_speeds


@functools.cache
def _make_moduli(space: Space, law: Law) -> Any:
    """Kernel of one thread: the wave moduli at F = I."""
    real, dim, pair, Constants, moduli = space.real, space.dim, space.row(2), law.Constants, law.wave_moduli

    @wp.kernel(module="unique", enable_backward=False)
    def moduli_at_rest(c: Constants, out: wp.array(dtype=pair)):
        M = moduli(wp.identity(n=wp.static(dim), dtype=real), c)
        out[0] = pair(M[0], M[1])

    return moduli_at_rest


@functools.cache
def _make_energy(space: Space, law: Law) -> Any:
    mat = space.mat
    Particles, Constants, density = structure(space, "Particles"), law.Constants, law.energy

    @wp.kernel(module="unique", enable_backward=False)
    def energy(first: int, F: wp.array(dtype=mat), particles: Particles, c: Constants, out: wp.array(dtype=wp.float64)):
        a = first + wp.tid()
        out[a] = wp.float64(particles.V0[a] * density(F[a], c))

    return energy


@functools.cache
def _make_carry(space: Space, law: Law) -> Any:
    mat, Constants, kept = space.mat, law.Constants, law.carry

    @wp.kernel(module="unique", enable_backward=False)
    def carry(first: int, F: wp.array(dtype=mat), c: Constants):
        a = first + wp.tid()
        F[a] = kept(F[a], c)

    return carry


@functools.cache
def _make_carry_history(space: Space, law: Law) -> Any:
    mat, row, Constants, kept = space.mat, space.row(law.history), law.Constants, law.carry

    @wp.kernel(module="unique", enable_backward=False)
    def carry_history(first: int, begin: int, F: wp.array(dtype=mat), history: wp.array(dtype=row), c: Constants):
        a = first + wp.tid()
        F_a, history_a = kept(F[a], history[a - begin], c)
        F[a] = F_a
        history[a - begin] = history_a

    return carry_history


class _Part(NamedTuple):
    first: int
    size: int
    law: Law
    constants: Any
    history: wp.array | None


def check_reference(materials: Sequence[Material], policy: ReferencePolicy) -> None:
    """Raise unless the reference moves every step where a material needs that.

    Raises:
        ValueError: a material that flows and a policy other than Always().
    """
    for material in materials:
        if material.flows and policy not in (Always(), Every(1)):
            raise ValueError(
                f"reference must be Always() for {type(material).__name__}, whose F is not counted from the initial "
                f"configuration, got {policy}"
            )


class Flux:
    """Stress, wave speeds and stored energy of all bodies; one launch per body and quantity.

    Args:
        bodies: (material, number of particles) in the order of the particle arrays.

    Attributes:
        bodies: particle indices of each body.
        histories: what the material of each body remembers, (particles of the body,) of ``Law.history`` reals, or None.
    """

    def __init__(self, space: Space, bodies: list[tuple[Material, int]], particles: Any, device: Any):
        self.space, self.particles, self.device = space, particles, device
        self._launch = Launcher(device)
        self.parts: list[_Part] = []
        first = 0
        for material, count in bodies:
            law = material.law(space)
            constants = law.Constants()
            for name, value in material.constants().items():
                setattr(constants, name, value)
            history = wp.zeros(count, dtype=space.row(law.history), device=device) if law.history else None
            self.parts.append(_Part(first, count, law, constants, history))
            first += count
        self.fields = allocate(space, "Flux", first, device, empty=("Pi", "tie", "drag"))
        self.bodies = [range(part.first, part.first + part.size) for part in self.parts]
        self.histories = [part.history for part in self.parts]

    def evolving(self) -> dict[str, wp.array]:
        """The histories of the materials that have one, by body; what a checkpoint must hold."""
        return {f"Flux.history.{i}": history for i, history in enumerate(self.histories) if history is not None}

    def keep_dual(self) -> None:
        """Have ``compute`` write Π too, for forces that take it from the array (M5)."""
        if not len(self.fields.Pi):
            self.fields.Pi = wp.zeros_like(self.fields.Q)

    def moduli(self) -> list[tuple[float, float]]:
        """Moduli of pressure and of shear waves at F = I [Pa] of each body; reads the device."""
        found = []
        for part in self.parts:
            out = wp.zeros(1, dtype=self.space.row(2), device=self.device)
            self._launch.once(_make_moduli(self.space, part.law), 1, [part.constants, out])
            found.append((float(out.numpy()[0, 0]), float(out.numpy()[0, 1])))
        return found

    def compute(self, F: wp.array, configuration: Configuration) -> None:
        """Q of the deformation gradients ``F`` (M1), and Π = Q Lᵀ (M5) if it is kept."""
        for part in self.parts:
            arguments = [F, configuration.fields, part.constants, self.fields]
            kernel = _make_flux(self.space, part.law, configuration.fixed, len(self.fields.Pi) > 0)
            self._launch(kernel, part.size, arguments, part.first)

    def wave_speeds(self, F: wp.array, grad_v: wp.array, configuration: Configuration, clock: Any) -> None:
        """Wave speeds measured in the reference; raise ``clock.rate`` to the largest rate of waves or strain [1/s]."""
        for part in self.parts:
            arguments = [F, grad_v, self.particles, configuration.fields, part.constants, self.fields, clock]
            kernel = _make_wave_speeds(self.space, part.law, configuration.fixed)
            self._launch(kernel, part.size, arguments, part.first)

    def energy(self, F: wp.array, out: wp.array) -> None:
        """Stored energy [J] of each particle."""
        for part in self.parts:
            arguments = [F, self.particles, part.constants, out]
            self._launch(_make_energy(self.space, part.law), part.size, arguments, part.first)

    def carry(self, F: wp.array) -> None:
        """Reduce updated F to what each material carries, in place, and update the histories."""
        for part in self.parts:
            if part.law.carry is None:
                continue
            if part.history is None:
                self._launch(_make_carry(self.space, part.law), part.size, [F, part.constants], part.first)
            else:
                arguments = [part.first, F, part.history, part.constants]
                self._launch(_make_carry_history(self.space, part.law), part.size, arguments, part.first)
