"""Linear stability of one step of the scheme, read from the step itself.

    python -m warp_eulsph.validation.stability [--quick] [--output DIR]

The scheme's own ``step`` is differentiated about a state at rest, so that whatever the scheme does is in the result and
no formula of it is repeated here. What the figures say is in docs/stability.md.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import fields
from ..geometry import box
from ..materials import Material, NeoHookean
from ..scheme.arrangement import Current
from ..scheme.lax_wendroff import LaxWendroff
from ..scheme.policy import Always, Never, ReferencePolicy
from ..scheme.time_step import TimeStep
from ..scheme.verlet import Verlet
from ..simulation import Body, Simulation
from ..weights import CubicSpline, Weight

# Step of the five-point difference quotient. Positions are in spacings, velocities in wave speeds: its errors are
# about (1e-3)^4 from the fifth derivative and 1e-16/1e-3 from round-off.
DIFFERENCE = 1e-3
# A Jacobian is good to about 1e-12. Neutral modes come in pairs (x += Δt v), whose eigenvalue 1 splits by the square
# root of that: growth below 1e-5 per step is not told from none.
RESOLVED = 1e-5


@dataclass(frozen=True, kw_only=True)
class Point:
    """One state at rest, and the scheme that steps it. Lengths are in spacings: the lattice has spacing 1.

    Args:
        dim: dimension.
        across: particles along each axis.
        periodic: whether the body fills a periodic box; otherwise it is a cube with free faces.
        jitter: largest random displacement of a particle along each axis, in [0, 0.5).
        strain: uniform F − I of the state: one number or ``dim`` along the axes, or ``dim`` rows of ``dim``; only
            periodic bodies hold it. The lattice is that of the reference, so Eulerian it is the strained one that has
            spacing 1.
        reference: Never() for total Lagrangian, Always() for Eulerian.
        scheme: options of the scheme.
        weight: SPH weight.
        dilation: smoothing length in spacings.
        cfl: Courant number as ``TimeStep`` counts it: Δt times the wave speed over the spacing measured in the
            reference, and times √(λ/4) where an L_a has an eigenvalue λ above 4.
        surface: as ``Body.surface``; 0.0 with a jitter, a strain and ``PairAreas(math.inf, …)`` is in equilibrium.
        material: its law; the speed of its pressure waves scales out.
        seed: of the jitter.
    """

    dim: int = 2
    across: int = 8
    periodic: bool = True
    jitter: float = 0.0
    strain: float | tuple[float, ...] | tuple[tuple[float, ...], ...] = 0.0
    reference: ReferencePolicy = Never()
    scheme: Verlet | LaxWendroff = Verlet()
    weight: Weight = CubicSpline()
    dilation: float = 1.3
    cfl: float = Verlet.cfl
    surface: float | None = None
    material: Material = NeoHookean(density=1.0, young=1.0, poisson=0.3)
    seed: int = 0

    def __post_init__(self) -> None:
        if self.reference not in (Never(), Always()):
            raise ValueError(f"reference must be Never() or Always(), got {self.reference}: others are no single step")
        if np.any(self.strain) and not self.periodic:
            raise ValueError(f"only a periodic body holds a strain without loads, got {self.strain} for a bounded one")

    @property
    def translates(self) -> bool:
        """Every particle sees the same arrangement, so that one of them tells the Jacobian."""
        return self.periodic and self.jitter == 0.0


class Step:
    """The step of a point's scheme as a map of deviations from the state at rest.

    A deviation is an array (n, c) with, per particle, those of x (in spacings), v (in wave speeds), F and the surface
    vector. Total Lagrangian the surface vector feeds back on nothing, nor does x without a tie (M16): they are
    left out. A moving reference is that of the current arrangement.

    Attributes:
        simulation: the simulation that steps.
        speed: wave speed measured in the reference [spacings per second].
        dt: time step [s].
    """

    def __init__(self, point: Point):
        self.point, dim = point, point.dim
        size = (float(point.across),) * dim
        x, volume = box((0.0,) * dim, size, 1.0, jitter=point.jitter, seed=point.seed)
        body = Body(x=x, volume=volume, material=point.material, surface=point.surface)
        self.simulation = Simulation(
            body,
            reference=point.reference,
            arrangement=Current(),
            scheme=point.scheme,
            time_step=TimeStep(fixed=1.0),
            weight=point.weight,
            dilation=point.dilation,
            periodic=size if point.periodic else None,
            sort=False,  # its arrays are written from outside
        )
        self.moving = not point.reference.fixed
        self._strain()
        shapes = {"x": (dim,), "v": (dim,), "F": (dim, dim), "surface": (dim,)}
        feeding = set(fields.STATE) if self.moving else {"v", "F"} | ({"x"} if point.scheme.tie is not None else set())
        self.shapes = {name: shapes[name] for name in fields.STATE if name in feeding}
        self._rest = self._read()

    @property
    def columns(self) -> int:
        """Reals per particle of a deviation."""
        return sum(math.prod(shape) for shape in self.shapes.values())

    def __call__(self, deviation: np.ndarray) -> np.ndarray:
        """Deviation after one step from the state at rest plus ``deviation``, both (n, columns)."""
        self._write(deviation)
        self.take()
        return self.deviation()

    def take(self) -> None:
        """One step of the simulation from where it is."""
        # A simulation just built does not refresh its reference before the first step; this state is never just built.
        self.simulation.stepper.steps = 1
        self.simulation.step()

    def deviation(self) -> np.ndarray:
        """The present state less that at rest, (n, columns)."""
        now = self._read()
        parts = [(now[name] - self._rest[name]) / self._scale(name) for name in self.shapes]
        return np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1)

    def scale(self, factor: float) -> None:
        """Shrink or stretch the present deviation, the potentials of the pair areas with it."""
        now = {name: getattr(self.simulation.stepper.U, name).numpy().copy() for name in self._rest}
        for name, rest in self._rest.items():
            getattr(self.simulation.stepper.U, name).assign(rest + factor * (now[name] - rest))
        for potential in self._potentials():
            potential.assign(factor * potential.numpy())

    def speeds(self) -> np.ndarray:
        """Velocities of the present state in wave speeds, (n, dim)."""
        return self.simulation.v / self.speed

    def start(self, deviation: np.ndarray) -> None:
        """Put the simulation at the state at rest plus ``deviation``."""
        self._write(deviation)

    def _strain(self) -> None:
        """Bring the body to the strain of the point, keeping the lattice of the reference, and read the time step."""
        simulation, point = self.simulation, self.point
        stepper, flux, configuration = simulation.stepper, simulation.stepper.flux, simulation.stepper.configuration
        strain = np.asarray(point.strain, dtype=float)
        F = np.eye(point.dim) + (strain if strain.ndim == 2 else np.diag(np.broadcast_to(strain, (point.dim,))))
        stepper.U.F.assign(np.broadcast_to(F, (len(simulation.x), point.dim, point.dim)))
        if self.moving:
            # The lattice of unit cells is the strained one: its particles were smaller before, h and spacing with them.
            particles, volume = simulation.particles, np.linalg.det(F)
            for field in (particles.V0, particles.mass):
                field.assign(field.numpy() / volume)
            for field in (particles.h, particles.spacing):
                field.assign(field.numpy() / volume ** (1.0 / point.dim))
            configuration.refresh(stepper.U)
        simulation.clock.ask()
        flux.wave_speeds(stepper.U.F, stepper.grad_v, configuration, simulation.clock.fields)
        self.speed = float(flux.fields.speed.numpy().max())
        self.dt = point.cfl / float(simulation.clock.fields.rate.numpy()[0])
        simulation.clock.option = TimeStep(fixed=self.dt)
        flux.compute(stepper.U.F, stepper.grad_v, configuration, simulation.clock.fields)
        self.stress = flux.fields.Q.numpy()[0].copy()
        self.modulus = simulation.particles.mass.numpy()[0] / configuration.fields.V.numpy()[0] * self.speed**2

    def _scale(self, name: str) -> float:
        return self.speed if name == "v" else 1.0

    def _read(self) -> dict[str, np.ndarray]:
        return {name: getattr(self.simulation.stepper.U, name).numpy().copy() for name in fields.STATE}

    def _write(self, deviation: np.ndarray) -> None:
        U, first = self.simulation.stepper.U, 0
        for name, rest in self._rest.items():
            state = rest
            if name in self.shapes:
                last = first + math.prod(self.shapes[name])
                state = rest + self._scale(name) * deviation[:, first:last].reshape(rest.shape)
                first = last
            getattr(U, name).assign(state)
        for medium in self.simulation.stepper.media:
            medium.keep_gradient(U)
        for potential in self._potentials():
            potential.zero_()

    def _potentials(self) -> list[Any]:
        """What the correction keeps from step to step: the pair areas' first guess (M11), zero at rest."""
        solver = getattr(self.simulation.stepper.stabiliser, "solver", None)
        return [] if solver is None else [solver.psi]

    def response(self, particle: int, column: int) -> np.ndarray:
        """Column of the Jacobian, (n, columns): five-point central difference."""
        deviation = np.zeros((len(self.simulation.x), self.columns))
        result = np.zeros_like(deviation)
        for factor, weight in ((2.0, -1.0), (1.0, 8.0), (-1.0, -8.0), (-2.0, 1.0)):
            deviation[particle, column] = factor * DIFFERENCE
            result += weight / (12.0 * DIFFERENCE) * self(deviation)
        return result


def eigenvalues(point: Point) -> np.ndarray:
    """All eigenvalues of the point's step about its state at rest.

    A lattice in a periodic box is translated into itself, so the response to one particle's deviations gives, by a
    discrete Fourier transform, one small matrix per wave vector (Bloch); elsewhere the whole Jacobian is formed.

    Raises:
        ValueError: a point that is not at rest; its forces move it within the step.
    """
    step = Step(point)
    check_rest(step)
    return np.linalg.eigvals(symbols(step) if point.translates else jacobian(step)).ravel()


def check_rest(step: Step) -> None:
    """Raise ValueError unless the state stays as it is for one step."""
    moved = np.abs(step(np.zeros((len(step.simulation.x), step.columns)))).max()
    if moved > 1e-9:
        raise ValueError(
            f"the state must be at rest, but one step changes it by {moved:.3g}; a strained body needs a lattice, or "
            "surface=0.0 and a correction that closes the pair areas"
        )


def jacobian(step: Step) -> np.ndarray:
    """Jacobian of the step, (n c, n c)."""
    n, c = len(step.simulation.x), step.columns
    columns = [step.response(a, j).ravel() for a in range(n) for j in range(c)]
    return np.stack(columns, axis=1)


def symbols(step: Step) -> np.ndarray:
    """Matrices (across, …, c, c) that the step multiplies plane waves with, wave vector by wave vector."""
    point, c = step.point, step.columns
    lattice = (point.across,) * point.dim
    responses = np.stack([step.response(0, j).reshape(*lattice, c) for j in range(c)], axis=-1)
    return np.fft.fftn(responses, axes=tuple(range(point.dim)))


def spectral_radius(point: Point) -> float:
    """Largest |λ| of one step of the library's scheme about a state at rest.

    The step is differentiated by five-point central differences of the simulation itself, with a fixed Δt (a step that
    follows the wave speeds changes at first order, but multiplies rates that are zero at rest). Neutral modes (rigid
    motions, and F and x that exert no force) have λ = 1, in pairs that round-off splits: values below 1 + ``RESOLVED``
    mean no growth. M13 is differentiable at rest: its bound is not reached there. Schemes that are not, M12 with a
    finite κ, are for ``growth``; without a stress at rest the pair areas exert nothing at first order and any κ gives
    the same.
    """
    return float(np.abs(eigenvalues(point)).max())


def growth(point: Point, steps: int = 400, seed: int = 0) -> float:
    """Growth of ln |v| per step in the second half of ``steps`` nonlinear steps from a random deviation of 1e-6.

    For what has no Jacobian (M12 is homogeneous of degree one in a small deviation, but not linear) or too large a
    one. Only v is measured, because neutral modes of x and F may drift; the deviation is shrunk whenever v has grown
    tenfold. Not above zero means that nothing grows.
    """
    step, amplitude = Step(point), 1e-6
    step.start(amplitude * np.random.default_rng(seed).standard_normal((len(step.simulation.x), step.columns)))
    logarithms, scaled = [], 0.0
    for _ in range(steps):
        step.take()
        size = float(np.sqrt(np.mean(np.square(step.speeds()))))
        if size == 0.0:
            return -math.inf
        logarithms.append(math.log(size) + scaled)
        if size > 10.0 * amplitude:
            step.scale(amplitude / size)
            scaled += math.log(size / amplitude)
    half = np.array(logarithms[steps // 2 :])
    return float(np.polyfit(np.arange(len(half)), half, 1)[0])


def largest_cfl(point: Point, cfls: Sequence[float] = tuple(np.arange(0.1, 2.6, 0.3)), within: float = 0.02) -> float:
    """Largest CFL up to which no mode grows: the first of ``cfls`` that fails, then bisected ``within``; 0 if none."""

    def holds(cfl: float) -> bool:
        return spectral_radius(replace(point, cfl=float(cfl))) <= 1.0 + RESOLVED

    good = 0.0
    for cfl in cfls:
        if not holds(cfl):
            bad = float(cfl)
            break
        good = float(cfl)
    else:
        return good
    while good > 0.0 and bad - good > within:
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good
