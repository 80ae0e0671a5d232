"""Robust dissipation: an acoustic upwind flux between reconstructed velocities (M9)."""

import functools
from dataclasses import dataclass

import warp as wp

from ..execution import Launcher
from ..fields import neighbour_structure, structure
from ..space import Space, difference
from ..structs import StateArrays
from .pair_forces import PairForces, make_pressure
from .reference import Configuration
from .sensor import Sensor
from .stabiliser import Stabiliser, Sums


@dataclass(frozen=True)
class Upwind:
    """Pairwise acoustic dissipation (M9): momentum exact, no drag on linear velocity fields.

    Args:
        epsilon: share of the upwind flux; 1 held in every case measured, ≤ 1/4 lets zero-energy modes grow. With a
            sensor 2 is for strong shocks: where nothing is reconstructed it is the viscosity of Monaghan (J. Comput.
            Phys. 136, 1997) with a signal velocity of c_a + c_b.
        sensor: where it sees oscillations, the jump is not reconstructed (first-order upwind); None never does that.
        stress: whether what the forces do to gradients goes through the stress, where the arrangement does not move:
            angular momentum is exact then, and smooth waves lose less: too little for the midpoint rule (M8), and for
            shocks and waves that a few particles must carry. By default that of bodies that yield (``defaults.py``).
        volume: whether volume flows between pairs too, from high to low pressure (M24), in bodies that carry J alone:
            without it nothing holds pressures of neighbouring layers together, and they part in liquids at rest.
    """

    epsilon: float = 1.0
    sensor: Sensor | None = None
    stress: bool = False
    volume: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.epsilon <= 2.0:
            raise ValueError(f"dissipation epsilon must be in [0, 2], got {self.epsilon}; 1 is the tested value")


@functools.cache
def upwind(space: Space) -> wp.Function:
    """``wp.func`` force on a from b [N]: A_ab ½ [Z n⊗n + Z_s (I − n⊗n)] · jump (M9), A_ab = V_a V_b |W'|.

    Z = ½ (ρc_a + ρc_b) is the mean impedance of pressure waves, Z_s of shear waves; n points from a to b as they are
    now, so that a body that turns is damped as one that does not, whatever the reference.

    Args (of the function): ξ = x_b − x_a in the reference, now, V_a V_b g_ab, the sums 2Z and 2Z_s, velocity jump.
    """
    real, vec = space.real, space.vec

    @wp.func
    def upwind(xi: vec, now: vec, VVg: real, Z: real, Z_shear: real, jump: vec) -> vec:
        # two particles at one place have no direction, and no normal part
        normal = now * (wp.dot(now, jump) * (Z - Z_shear) / wp.max(wp.dot(now, now), real(1e-30)))
        return (normal + jump * Z_shear) * (VVg * wp.length(xi) * real(0.25))

    return upwind


@functools.cache
def blend(space: Space) -> wp.Function:
    """``wp.func`` jump per direction: ε {(1 − d) r_ab + d (v_b − v_a)}, d from the sensor of both ends (M9)."""
    real, vec, dim = space.real, space.vec, space.dim

    @wp.func
    def blend(reconstructed: vec, plain: vec, epsilon: real, d_a: vec, d_b: vec) -> vec:
        jump = vec()
        for i in range(wp.static(dim)):
            d = wp.max(d_a[i], d_b[i])
            jump[i] = ((real(1.0) - d) * reconstructed[i] + d * plain[i]) * epsilon
        return jump

    return blend


@functools.cache
def jump_between(space: Space, sensed: bool) -> wp.Function:
    """``wp.func`` jump of M9 from v_b − v_a, ∇v_a + ∇v_b and ξ: reconstructed as far as d lets it where ``sensed``."""
    real, vec, mat, mix = space.real, space.vec, space.mat, blend(space)

    @wp.func
    def jump_between(plain: vec, gradients: mat, xi: vec, epsilon: real, d_a: vec, d_b: vec) -> vec:
        reconstructed = plain - gradients @ (xi * real(0.5))
        if wp.static(sensed):
            return mix(reconstructed, plain, epsilon, d_a, d_b)
        return reconstructed * epsilon

    return jump_between


@functools.cache
def upwind_between(space: Space, sensed: bool) -> wp.Function:
    """``wp.func`` D_ab of M9 [N]: the force on a from b, which stands at k in the lists; antisymmetric."""
    real, vec, mat = space.real, space.vec, space.mat
    Reference, Flux = structure(space, "Reference"), structure(space, "Flux")
    Neighbours = neighbour_structure(space)
    separation, pair_force, jump_of = difference(space), upwind(space), jump_between(space, sensed)

    @wp.func
    def upwind_between(
        a: int,
        k: int,
        reference: Reference,
        near: Neighbours,
        flux: Flux,
        x: wp.array(dtype=vec),
        v: wp.array(dtype=vec),
        grad_v: wp.array(dtype=mat),
        epsilon: real,
        sensor: wp.array(dtype=vec),
    ) -> vec:
        b = near.index[k]
        xi = separation(reference.x[b], reference.x[a], near.box)
        jump = jump_of(v[b] - v[a], grad_v[a] + grad_v[b], xi, epsilon, sensor[a], sensor[b])
        Z, Z_shear = flux.impedance[a] + flux.impedance[b], flux.shear_impedance[a] + flux.shear_impedance[b]
        now = separation(x[b], x[a], near.box)
        return pair_force(xi, now, reference.V[a] * near.w[k], Z, Z_shear, jump)

    return upwind_between


@functools.cache
def _make_forces(space: Space, joined: bool, balanced: bool, sensed: bool, pressure: bool) -> wp.Kernel:
    """Kernel, portable: M9; ``joined`` with M5, for both read the same of each pair, and with ``pressure`` ∇_k p (M4).

    M5 takes ``balanced`` positions (M13) or those of the particles.
    """
    real, vec, mat, row, rows_of_p = space.real, space.vec, space.mat, space.row(1), space.row_gradient(1)
    Reference, Flux = structure(space, "Reference"), structure(space, "Flux")
    Neighbours, pair_force = neighbour_structure(space), upwind_between(space, sensed)
    separation = difference(space)

    @wp.kernel(module="unique", enable_backward=False)
    def pair_forces_portable(
        first: int,
        reference: Reference,
        near: Neighbours,
        flux: Flux,
        x: wp.array(dtype=vec),
        v: wp.array(dtype=vec),
        grad_v: wp.array(dtype=mat),
        epsilon: real,
        sensor: wp.array(dtype=vec),
        p: wp.array(dtype=row),
        internal: wp.array(dtype=vec),
        dissipation: wp.array(dtype=vec),
        grad_p: wp.array(dtype=rows_of_p),
    ):
        a = first + wp.tid()
        force, drag, slope = vec(), vec(), vec()
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            xi = separation(reference.x[b], reference.x[a], near.box)
            drag += pair_force(a, k, reference, near, flux, x, v, grad_v, epsilon, sensor)
            if wp.static(pressure):
                slope += xi * near.w[k] * (p[b][0] - p[a][0])
            if wp.static(balanced):
                xi = separation(reference.balanced[b], reference.balanced[a], near.box)
            if wp.static(joined):
                force += (flux.Pi[a] + flux.Pi[b]) @ (xi * near.w[k])
        dissipation[a] = drag
        if wp.static(joined):
            internal[a] = force * reference.V[a]
        if wp.static(pressure):
            sums = rows_of_p()
            for i in range(wp.static(space.dim)):
                sums[0, i] = slope[i]
            grad_p[a] = sums @ reference.L[a]

    return pair_forces_portable


class UpwindForces(Stabiliser):
    """M9 alone, for references that need no correction."""

    corrects = False

    def __init__(self, space: Space, device: wp.DeviceLike):
        self.space, self.device, self._launch = space, device, Launcher(device)
        self._by_simd = PairForces(space, device)
        self._no_p = wp.zeros(0, dtype=space.row(1), device=device)
        self._no_gradient = wp.zeros(0, dtype=space.row_gradient(1), device=device)

    def refresh(self, configuration: Configuration, state: StateArrays) -> None:
        """Nothing to prepare: M9 needs the lists only."""

    def takes_dual(self, configuration: Configuration, sensed: bool) -> bool:
        """The portable kernels do, the SIMD pass makes its own."""
        return not configuration.pairs_by_simd(sensed)

    def sums_pressure(self, configuration: Configuration, sensed: bool) -> bool:
        """Where M9 comes with M5, and M4 joins the same positions."""
        return not self.balances and configuration.simd == configuration.pairs_by_simd(sensed)

    def compute(self, sums: Sums, x: wp.array, v: wp.array) -> None:
        """Internal force (M5) and dissipation (M9), and the gradient of p where it is asked for."""
        configuration, flux, forces, sensed = sums.configuration, sums.flux, sums.forces, sums.sensor is not None
        pressure = sums.grad_p is not None
        if pressure:
            self._launch(make_pressure(self.space), len(v), [flux, sums.p])
        if not self.takes_dual(configuration, sensed):
            self._by_simd.compute(configuration, flux, x, v, sums.grad_v, sums.epsilon, forces, sums.grad_p)
            return
        joined = not configuration.simd
        if not joined:  # with a sensor, of which the SIMD pass does not know
            configuration.divergence(flux.Pi, forces.internal)
        arguments = [configuration.fields, configuration.near, flux, x, v, sums.grad_v, sums.epsilon]
        arguments += [sums.sensor if sensed else v, sums.p if pressure else self._no_p]
        arguments += [forces.internal, forces.dissipation, sums.grad_p if pressure else self._no_gradient]
        kernel = _make_forces(self.space, joined, joined and self.balances, sensed, pressure)
        self._launch(kernel, len(v), arguments)
