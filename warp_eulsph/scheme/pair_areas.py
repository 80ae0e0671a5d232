"""Closed pair areas: the defect of the dual divergence taken back pair by pair (M11), never feeding energy (M12)."""

import functools
import math
from dataclasses import dataclass

import warp as wp

from ..execution import Launcher
from ..fields import neighbour_structure, structure
from ..operators.laplacian import LaplacianSolver
from ..reduce import Sum
from ..space import Space
from ..structs import ParticleArrays, StateArrays
from .dissipation import UpwindForces, upwind_between
from .flux import Flux
from .reference import Configuration
from .stabiliser import Correction, Stabiliser, Sums


@dataclass(frozen=True)
class PairAreas(Correction):
    """Force correction that makes a moving reference stable (M11, M12); momentum stays exact.

    Args:
        kappa: around each particle the correction may feed what it takes there plus ``kappa`` times what M9 dissipates
            (M12); 1 keeps energy from growing, ``math.inf`` is M11 without a limit.
        iterations: conjugate-gradient iterations per refresh, warm-started.
    """

    kappa: float = 1.0
    iterations: int = 5
    per_body = True

    def __post_init__(self) -> None:
        if not self.kappa >= 0.0:
            raise ValueError(f"kappa must be at least 0, got {self.kappa}; 1 bounds the energy, math.inf is unlimited")
        if self.iterations < 1:
            raise ValueError(f"iterations must be at least 1, got {self.iterations}")

    @property
    def limited(self) -> bool:
        """Whether M12 limits the correction."""
        return math.isfinite(self.kappa)

    def build(self, space: Space, particles: ParticleArrays, flux: Flux, device: wp.DeviceLike) -> "ClosedPairs":
        """Allocate for the bodies of ``flux``, each a range of particles."""
        return ClosedPairs(self, space, particles, flux.bodies, device)


@functools.cache
def _make_remove_mean(space: Space) -> wp.Kernel:
    real, vec = space.real, space.vec

    @wp.kernel(module="unique", enable_backward=False)
    def remove_mean(first: int, count: int, total: wp.array(dtype=vec), out: wp.array(dtype=vec)):
        a = first + wp.tid()
        out[a] = out[a] - total[0] / real(count)

    return remove_mean


@functools.cache
def admitted(space: Space) -> wp.Function:
    """``wp.func`` R_a of M12: the share of what it is fed that a particle can pay for, in [0, 1].

    Args (of the function): powers [W] that the correction feeds and takes in the particle's pairs, power that the
    dissipation takes there, κ.
    """
    real = space.real

    @wp.func
    def admitted(fed: real, taken: real, dissipated: real, kappa: real) -> real:
        share = real(1.0)
        if fed > real(0.0):
            share = wp.clamp((taken + kappa * dissipated) / fed, real(0.0), real(1.0))
        return share

    return admitted


@functools.cache
def _make_dissipate(space: Space, sensed: bool) -> wp.Kernel:
    """Kernel: M9, and from the powers of M9 and of M11 in the particle's pairs what M12 admits, R_a."""
    real, vec, mat = space.real, space.vec, space.mat
    Reference, Flux, Neighbours = structure(space, "Reference"), structure(space, "Flux"), neighbour_structure(space)
    pair_force, share = upwind_between(space, sensed), admitted(space)

    @wp.kernel(module="unique", enable_backward=False)
    def dissipate_and_budget(
        first: int,
        reference: Reference,
        near: Neighbours,
        flux: Flux,
        x: wp.array(dtype=vec),
        v: wp.array(dtype=vec),
        grad_v: wp.array(dtype=mat),
        epsilon: real,
        sensor: wp.array(dtype=vec),
        psi: wp.array(dtype=vec),
        kappa: real,
        out: wp.array(dtype=vec),
        admission: wp.array(dtype=real),
    ):
        a = first + wp.tid()
        V_a, v_a, Q_a, psi_a = reference.V[a], v[a], flux.Q[a], psi[a]
        dissipation = vec()
        fed = real(0.0)
        taken = real(0.0)
        dissipated = real(0.0)
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            plain = v[b] - v_a
            upwind_ab = pair_force(a, k, reference, near, flux, x, v, grad_v, epsilon, sensor)
            dissipation += upwind_ab
            dissipated += wp.dot(upwind_ab, plain)
            p_ab = -wp.dot((Q_a + flux.Q[b]) @ (psi_a - psi[b]), plain) * real(0.5) * (V_a * near.w[k])
            fed += wp.max(p_ab, real(0.0))
            taken += wp.max(-p_ab, real(0.0))
        out[a] = dissipation
        admission[a] = share(fed, taken, dissipated, kappa)

    return dissipate_and_budget


@functools.cache
def _make_correct(space: Space, limited: bool) -> wp.Kernel:
    """Kernel: the correction ½ Σ_b φ_ab (Q_a + Q_b) c_ab (M11), feeding pairs by φ_ab = min(R_a, R_b) only (M12)."""
    real, vec, mat = space.real, space.vec, space.mat
    Reference, Neighbours = structure(space, "Reference"), neighbour_structure(space)

    @wp.kernel(module="unique", enable_backward=False)
    def correct(
        first: int,
        reference: Reference,
        near: Neighbours,
        Q: wp.array(dtype=mat),
        v: wp.array(dtype=vec),
        psi: wp.array(dtype=vec),
        admission: wp.array(dtype=real),
        out: wp.array(dtype=vec),
    ):
        a = first + wp.tid()
        V_a, v_a, Q_a, psi_a = reference.V[a], v[a], Q[a], psi[a]
        correction = vec()
        for k in range(near.start[a], near.stop[a], near.stride):
            b = near.index[k]
            f_ab = (Q_a + Q[b]) @ ((psi_a - psi[b]) * (real(0.5) * V_a * near.w[k]))
            if wp.static(limited) and wp.dot(f_ab, v[b] - v_a) < real(0.0):
                f_ab = f_ab * wp.min(admission[a], admission[b])
            correction += f_ab
        out[a] = correction

    return correct


class ClosedPairs(Stabiliser):
    """The pair areas c_ab = ω_ab (ψ_a − ψ_b) of the present reference, and the forces they correct."""

    def __init__(
        self, option: PairAreas, space: Space, particles: ParticleArrays, bodies: list[range], device: wp.DeviceLike
    ):
        self.option, self.space, self.bodies, self.device = option, space, bodies, device
        self.upwind, self._launch = UpwindForces(space, device), Launcher(device)
        self.solver = LaplacianSolver(space, len(particles.mass), device)
        self.admission = wp.zeros(len(particles.mass), dtype=space.real, device=device)
        self._sum, self._total = (
            Sum(space.vec, len(particles.mass), device),
            wp.zeros(1, dtype=space.vec, device=device),
        )

    def refresh(self, configuration: Configuration, state: StateArrays) -> None:
        """Solve for the potentials ψ of the new reference, body by body free of a mean (M11)."""
        defect = self.solver.residual
        configuration.defect(state.surface, defect)
        for body in self.bodies:
            self._sum(defect[body.start : body.stop], self._total)
            arguments = [len(body), self._total, defect]
            self._launch(_make_remove_mean(self.space), len(body), arguments, body.start)
            self.solver.solve(configuration.fields, configuration.near, body, self.option.iterations)

    def evolving(self) -> dict[str, wp.array]:
        """The potentials: in use until the next refresh, whose first guess they are."""
        return {"ClosedPairs.psi": self.solver.psi}

    def compute(self, sums: Sums, x: wp.array, v: wp.array) -> None:
        """Internal force (M5), dissipation (M9) and correction (M11, M12)."""
        configuration, flux, forces = sums.configuration, sums.flux, sums.forces
        if self.option.limited:
            configuration.divergence(flux.Pi, forces.internal)
            arguments = [configuration.fields, configuration.near, flux, x, v, sums.grad_v, sums.epsilon]
            arguments += [sums.sensor if sums.sensor is not None else v, self.solver.psi, self.option.kappa]
            arguments += [forces.dissipation, self.admission]
            self._launch(_make_dissipate(self.space, sums.sensor is not None), len(v), arguments)
        else:
            self.upwind.compute(sums, x, v)
        arguments = [configuration.fields, configuration.near, flux.Q, v, self.solver.psi, self.admission]
        arguments += [forces.correction]
        self._launch(_make_correct(self.space, self.option.limited), len(v), arguments)
